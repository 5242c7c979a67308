//! What clothes claim.
