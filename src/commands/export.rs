//! `effigy export`: an avatar and a motion, for other programs.

use std::sync::Arc;

use anyhow::Context as _;
use effigy_avatar::{
    Avatar, Bake, BakeConfig, BakeError, DriveConfig, Driver,
    export::{GlbOptions, write_glb},
};
use effigy_registration::motion::{self, Motion, RestBody};

use super::chain::body_model;
use crate::{cli::ExportArgs, interrupt, progress::Progress, say::say};

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
    let avatar = Arc::new(avatar);
    let bake = match motion
        .as_ref()
        .filter(|motion| args.modes > 0 && !motion.poses.is_empty())
    {
        Some(motion) => Some(baked(&avatar, motion, usize::from(args.modes))?),
        None => None,
    };
    let options =
        GlbOptions { motion: motion.as_ref(), bake: bake.as_ref(), ..GlbOptions::default() };
    write_glb(&args.glb, &avatar, &options)?;
    let played = motion.map_or(0.0, |motion| motion.duration_secs());
    say!(
        "{}: {} vertices, {played:.1} s of motion",
        args.glb.display(),
        avatar.topology.vertices_in_unit.len()
    );
    if let Some(bake) = bake {
        say!("{}", described(&bake));
    }
    Ok(())
}

/// The clothes' change over a motion; a bar shows how far it is.
fn baked(avatar: &Arc<Avatar>, motion: &Motion, modes: usize) -> anyhow::Result<Bake> {
    let config = BakeConfig { modes, ..BakeConfig::default() };
    let mut driver = Driver::new(Arc::clone(avatar), DriveConfig::default());
    let mut bar: Option<Progress> = None;
    let bake = Bake::of_motion(&mut driver, motion, &config, &mut |done, of| {
        bar.get_or_insert_with(|| Progress::new("baking", Some(of as u64)))
            .advance(done as u64);
        !interrupt::requested()
    })?;
    if let Some(bar) = bar {
        bar.finish();
    }
    bake.context("interrupted: no file was written")
}

fn described(bake: &Bake) -> String {
    let BakeError { rms_mm, p95_mm, still_rms_mm } = bake.error;
    format!(
        "clothes follow the pose in {} morph targets: {rms_mm:.2} mm rms (p95 {p95_mm:.2}) from the full field between \
         keys, where a still shape is {still_rms_mm:.2} mm off",
        bake.modes_m.len()
    )
}
