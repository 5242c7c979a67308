//! One frame after another, nothing dropped: what replays, headless demos and tests run.

use std::sync::Arc;

use effigy_capture::FrameSource;
use effigy_registration::BodyModel;

use super::{
    avatar_stage::AvatarStage,
    clock::Clock,
    outputs::Outputs,
    run_log::{Captured, RunLog},
    settings::Settings,
    track_stage::stages,
};
use crate::interrupt;

/// Takes a source to its end (or to Ctrl-C); the same source gives the same result, bit for bit.
pub(crate) fn run(
    source: &mut dyn FrameSource,
    body: &Arc<BodyModel>,
    settings: &Settings,
    (avatar, outputs): (&mut AvatarStage, &mut Outputs),
    clock: Clock,
) -> anyhow::Result<RunLog> {
    let (mut cleaning, mut tracking, hand_over) =
        stages(source.calibration(), Arc::clone(body), settings, clock);
    let mut log = RunLog::new(clock);
    let mut captured = Captured::default();
    let mut before = None;
    while !interrupt::requested() {
        let Some(frame) = log.timings.time(&clock, "source", || source.next_frame())? else {
            break;
        };
        // A sensor that started over, or recordings put together.
        if before.is_some_and(|before| frame.timestamp < before) {
            tracking.jumped();
        }
        before = Some(frame.timestamp);
        log.delivered(&frame);
        captured.count(&frame, false);
        let tracked = tracking.process(cleaning.process(&frame)?);
        let registered = &tracked.registered;
        log.registered(&tracked);
        let decided = avatar.advance(registered)?;
        avatar.hand_over(&decided, tracked.number, &hand_over);
        let mesh = avatar.drive(registered);
        outputs.record(&frame, &decided)?;
        outputs.frame(&frame, registered, mesh.as_ref(), (avatar, &log))?;
    }
    log.captured(&captured);
    outputs.wait_for_avatar(avatar)?;
    log.avatar_made(avatar);
    Ok(log)
}
