//! What the noise claims.
