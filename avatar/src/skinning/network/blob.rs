//! The networks as bytes: safetensors in half precision, with sizes and provenance in the metadata.

use std::{collections::HashMap, path::Path, sync::OnceLock};

use effigy_registration::smpl::{BodyIdentity, JOINT_COUNT};
use half::f16;
use safetensors::{Dtype, SafeTensors, serialize, tensor::TensorView};

use super::{
    BODY_FEATURES, MIXTURE_OUTPUTS, NetworkConfig, SkinningNetwork, SkinningNetworks, net::Net,
};
use crate::{error::AvatarError, hyper::Provenance, nn::file::read_at_most};

/// Version of the layout; a reader refuses any other.
pub const NETWORKS_FORMAT: &str = "effigy-skinning-1";
static SHIPPED_BYTES: &[u8] = include_bytes!("../../../assets/skinning_live.safetensors");
/// Bounds on what a file may ask us to allocate.
const MOST_BYTES: u64 = 256 << 20;
const MOST_WIDTH: usize = 1024;
const MOST_PARAMETERS: usize = 50_000_000;

impl SkinningNetworks {
    /// The networks as a safetensors file, weights in f16, biases in f32.
    pub fn to_bytes(&self) -> Result<Vec<u8>, AvatarError> {
        let mut stored = Vec::new();
        for (kind, network) in self.named() {
            for place in &network.net.layout.places {
                let values = &network.parameters[place.offset..][..place.len()];
                let is_short = place.name.ends_with(".weight");
                let bytes: Vec<u8> = if is_short {
                    let short = |x: &f32| f16::from_f32(*x).to_le_bytes();
                    values.iter().flat_map(short).collect()
                } else {
                    values.iter().flat_map(|x| x.to_le_bytes()).collect()
                };
                let dtype = if is_short { Dtype::F16 } else { Dtype::F32 };
                stored.push((
                    format!("{kind}.{}", place.name),
                    dtype,
                    place.shape.clone(),
                    bytes,
                ));
            }
        }
        let views = stored
            .iter()
            .map(|(name, dtype, shape, bytes)| {
                Ok((
                    name.as_str(),
                    TensorView::new(*dtype, shape.clone(), bytes)?,
                ))
            })
            .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
            .map_err(AvatarError::WriteNetwork)?;
        let configs = self.named().map(|(_, network)| network.config());
        let metadata = HashMap::from([
            ("format".to_owned(), NETWORKS_FORMAT.to_owned()),
            ("config".to_owned(), json(&configs)),
            ("provenance".to_owned(), json(&self.provenance)),
        ]);
        serialize(views, Some(metadata)).map_err(AvatarError::WriteNetwork)
    }

    /// Reads what [`Self::to_bytes`] wrote; refuses unknown formats, wrong shapes and numbers that are not finite.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, AvatarError> {
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(AvatarError::ReadNetwork)?;
        let metadata = header.metadata().clone().unwrap_or_default();
        let format = metadata.get("format").cloned().unwrap_or_default();
        if format != NETWORKS_FORMAT {
            return Err(AvatarError::NetworkFormat { expected: NETWORKS_FORMAT, found: format });
        }
        let text = |key: &str| metadata.get(key).map_or("null", String::as_str);
        let wrong = |key| move |source| AvatarError::NetworkMetadata { key, source };
        let configs: [NetworkConfig; 3] =
            serde_json::from_str(text("config")).map_err(wrong("config"))?;
        let provenance: Provenance =
            serde_json::from_str(text("provenance")).map_err(wrong("provenance"))?;
        let file = SafeTensors::deserialize(bytes).map_err(AvatarError::ReadNetwork)?;
        let [inverse, forward, labels] = configs;
        for (config, features, most) in [
            (inverse, BODY_FEATURES, MIXTURE_OUTPUTS),
            (forward, BODY_FEATURES, MIXTURE_OUTPUTS),
            (labels, 0, JOINT_COUNT),
        ] {
            if config.features != features || ![JOINT_COUNT, most].contains(&config.outputs) {
                return Err(AvatarError::SkinningUnknown { config });
            }
        }
        Ok(Self {
            inverse: read(&file, "inverse", inverse)?,
            forward: read(&file, "forward", forward)?,
            labels: read(&file, "labels", labels)?,
            provenance,
        })
    }

    /// Reads a file of networks that were trained with this body.
    pub fn load(path: &Path, body: BodyIdentity) -> Result<Self, AvatarError> {
        let bytes = read_at_most(path, MOST_BYTES)?;
        let networks = Self::from_bytes(&bytes).map_err(AvatarError::in_file(path))?;
        networks.of_body(body, path)
    }

    /// The networks that ship with the program; refused for another body than the built-in one.
    ///
    /// # Panics
    /// If the embedded file is broken, which a test excludes.
    pub fn shipped(body: BodyIdentity) -> Result<Self, AvatarError> {
        static SHIPPED: OnceLock<SkinningNetworks> = OnceLock::new();
        let networks = SHIPPED
            .get_or_init(|| Self::from_bytes(SHIPPED_BYTES).expect("the embedded file is whole"));
        networks
            .clone()
            .of_body(body, Path::new("the embedded skinning networks"))
    }

    fn of_body(self, body: BodyIdentity, path: &Path) -> Result<Self, AvatarError> {
        match self.provenance.body {
            Some(found) if found == body => Ok(self),
            found => Err(AvatarError::SkinningOtherBody {
                path: path.to_owned(),
                found: found.map_or_else(|| "none".to_owned(), |found| found.to_string()),
                expected: body.to_string(),
            }),
        }
    }

    fn named(&self) -> [(&'static str, &SkinningNetwork); 3] {
        let Self { inverse, forward, labels, .. } = self;
        [
            ("inverse", inverse),
            ("forward", forward),
            ("labels", labels),
        ]
    }
}

fn read(
    file: &SafeTensors<'_>,
    kind: &str,
    config: NetworkConfig,
) -> Result<SkinningNetwork, AvatarError> {
    check_bounds(&config)?;
    let net = Net::new(config);
    if net.layout.count > MOST_PARAMETERS {
        return Err(AvatarError::SkinningTooLarge { config });
    }
    let mut parameters = vec![0.0; net.layout.count];
    for place in &net.layout.places {
        let name = format!("{kind}.{}", place.name);
        let tensor = file.tensor(&name).map_err(AvatarError::ReadNetwork)?;
        if tensor.shape() != place.shape {
            let (expected, found) = (place.shape.clone(), tensor.shape().to_vec());
            return Err(AvatarError::TensorShape { name, expected, found });
        }
        let own = &mut parameters[place.offset..][..place.len()];
        match tensor.dtype() {
            Dtype::F32 => {
                for (own, bytes) in own.iter_mut().zip(tensor.data().as_chunks().0) {
                    *own = f32::from_le_bytes(*bytes);
                }
            }
            Dtype::F16 => {
                for (own, bytes) in own.iter_mut().zip(tensor.data().as_chunks().0) {
                    *own = f16::from_le_bytes(*bytes).to_f32();
                }
            }
            other => {
                return Err(AvatarError::TensorType { name, found: format!("{other:?}") });
            }
        }
        if let Some(index) = own.iter().position(|x| !x.is_finite()) {
            return Err(AvatarError::TensorNotFinite { name, index });
        }
    }
    Ok(SkinningNetwork { net, parameters })
}

fn check_bounds(config: &NetworkConfig) -> Result<(), AvatarError> {
    let widths = [
        config.hidden,
        config.channels,
        config.side,
        config.unet.width,
    ];
    let widths = widths.iter().chain(&config.decoder);
    let groups = config.groups.max(1);
    let is_sane = widths
        .copied()
        .all(|width| (2..=MOST_WIDTH).contains(&width))
        && config.features <= MOST_WIDTH
        && (1..=16).contains(&config.blocks)
        && (1..=6).contains(&config.unet.depth)
        && config.unet.width << config.unet.depth <= 2 * MOST_WIDTH
        && config.side.is_multiple_of(1 << (config.unet.depth - 1))
        && config.side >> (config.unet.depth - 1) >= 2
        && config
            .decoder
            .iter()
            .all(|width| width.is_multiple_of(groups) && width / groups > 1)
        && (0.1..=10.0).contains(&config.half_extent);
    if is_sane {
        Ok(())
    } else {
        Err(AvatarError::SkinningTooLarge { config: *config })
    }
}

fn json(what: &impl serde::Serialize) -> String {
    serde_json::to_string(what).expect("plain data serialises")
}

#[cfg(test)]
mod tests {
    use effigy_registration::smpl::builtin;

    use super::*;

    #[test]
    fn embedded_networks_are_whole_and_of_the_built_in_body() {
        let networks = SkinningNetworks::shipped(builtin::body().identity).unwrap();
        assert!(networks.provenance.training.contains("train skinning"));
        // Issue's bound for all that is embedded: 25 MB; this is the smallest part of it.
        assert!(SHIPPED_BYTES.len() < 1_000_000);
        let other = BodyIdentity([7; 16]);
        let refusal = SkinningNetworks::shipped(other).unwrap_err().to_string();
        assert!(refusal.contains("embedded"), "{refusal}");
    }
}
