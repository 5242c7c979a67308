//! The prior that ships with the program.

use std::sync::OnceLock;

use super::{config::HyperConfig, network::HyperNetwork};

/// Shape of the shipped prior.
pub const PRIOR_CONFIG: HyperConfig = HyperConfig::LIVE;

static PRIOR_BYTES: &[u8] = include_bytes!("../../assets/prior_live.safetensors");

/// The meta-learned network that fine-tuning starts from. `provenance` says how it was trained, and for
/// which body.
///
/// # Panics
/// If the embedded file is broken, which a test excludes.
pub fn prior() -> HyperNetwork {
    static PRIOR: OnceLock<HyperNetwork> = OnceLock::new();
    PRIOR
        .get_or_init(|| {
            let prior = HyperNetwork::from_bytes(PRIOR_BYTES).expect("the embedded prior is whole");
            if prior.provenance.is_placeholder {
                tracing::warn!(
                    training = prior.provenance.training,
                    "the embedded prior is a placeholder: avatars will be poor"
                );
            }
            prior
        })
        .clone()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn embedded_prior_is_whole_and_of_the_shipped_shape() {
        assert_eq!(prior().config(), PRIOR_CONFIG);
        // The design allows 12 MB for it.
        assert!(PRIOR_BYTES.len() < 12_000_000);
    }
}
