//! Scenes and assertions shared by the cross-crate tests.
