//! `effigy export`: an avatar and a motion, for other programs.

use effigy_avatar::{
    Avatar,
    export::{GlbOptions, write_glb},
};
use effigy_registration::motion::{self, RestBody};

use super::chain::body_model;
use crate::{cli::ExportArgs, say::say};

pub(crate) fn run(args: &ExportArgs) -> anyhow::Result<()> {
    let body = body_model(args.body.as_deref())?;
    let avatar = Avatar::load(&args.avatar, body.identity)?;
    let motion = match &args.motion {
        Some(path) => Some(motion::open(
            path,
            &RestBody::of(&body, &avatar.subject.betas),
        )?),
        None => None,
    };
    write_glb(
        &args.glb,
        &avatar,
        &GlbOptions { motion: motion.as_ref(), ..GlbOptions::default() },
    )?;
    let played = motion.map_or(0.0, |motion| motion.duration_secs());
    say!(
        "{}: {} vertices, {played:.1} s of motion",
        args.glb.display(),
        avatar.topology.vertices_in_unit.len()
    );
    Ok(())
}
