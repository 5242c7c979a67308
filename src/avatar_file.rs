//! Avatar files, with the one kind of field this program knows.

use std::{path::Path, sync::Arc};

use effigy_avatar::{Avatar, AvatarError, PoseField, checkpoint, hyper::HyperNetwork};
use effigy_registration::smpl::BodyIdentity;

pub(crate) fn read(path: &Path, body: &BodyIdentity) -> Result<Avatar, AvatarError> {
    checkpoint::read(path, *body, &decode)
}

fn decode(kind: &str, bytes: &[u8]) -> Result<Arc<dyn PoseField>, AvatarError> {
    if kind != HyperNetwork::KIND {
        return Err(AvatarError::UnknownField {
            found: kind.to_owned(),
            expected: HyperNetwork::KIND.to_owned(),
        });
    }
    Ok(Arc::new(HyperNetwork::from_bytes(bytes)?))
}
