//! Drive and fine-tuning on a graphics card, in turn with the processor's, and how far the two are apart.

use std::sync::Arc;

use effigy_avatar::{
    Avatar, DriveConfig, Driver,
    fine_tune::FineTuner,
    gpu::{Gpu, GpuDriver, GpuError},
};
use effigy_capture::FrameId;
use effigy_registration::BodyParams;

use super::{Row, in_turn::in_turn};
use crate::interrupt;

/// What is asked of a card; and of one in software, which takes a hundred times as long.
const COMPARED: usize = 30;
const ROUNDS: usize = 600;
const IN_SOFTWARE: usize = 3;

/// Frames between two poses that are compared.
const FRAMES_APART: usize = 37;

/// A step of fine-tuning on this machine's fastest adapter; `made` makes two tuners that are alike.
pub(super) fn step_rows(
    name: &str,
    made: &dyn Fn() -> anyhow::Result<FineTuner>,
    rounds: usize,
) -> anyhow::Result<Vec<Row>> {
    let Some(gpu) = card() else {
        return Ok(Vec::new());
    };
    let (mut cpu, mut card) = (made()?, made()?);
    card.lend(&gpu);
    let rounds = if gpu.is_software() { 1 } else { rounds };
    let mut failed = [None, None];
    let [of_cpu, of_card] = &mut failed;
    let [by_cpu, by_card] = in_turn(
        rounds,
        [
            &mut || *of_cpu = of_cpu.take().or(cpu.step().err()),
            &mut || *of_card = of_card.take().or(card.step().err()),
        ],
    );
    if let Some(error) = failed.into_iter().flatten().next() {
        return Err(error.into());
    }
    if let Some(reason) = card.gave_up() {
        eprintln!("effigy: no rows about fine-tuning on a graphics card: {reason}");
        return Ok(Vec::new());
    }
    let name = format!("fine-tuning step, {name}, on {}{}", gpu.name(), kind(&gpu));
    Ok(vec![
        Row::new(name, by_card * 1e3, "ms").against("the processor", by_cpu / by_card),
    ])
}

/// This machine's fastest adapter, or nothing but its reason.
fn card() -> Option<Arc<Gpu>> {
    Gpu::of_this_machine()
        .inspect_err(|reason| eprintln!("effigy: no rows about a graphics card: {reason}"))
        .ok()
        .map(Arc::new)
}

fn kind(gpu: &Gpu) -> &'static str {
    if gpu.is_software() {
        " (in software)"
    } else {
        ""
    }
}

/// On this machine's fastest adapter, with the avatar's own vertices and with more than three times as many; an adapter in
/// software is measured too, and says so in its rows.
pub(super) fn rows(
    own: &Arc<Avatar>,
    fine: impl FnOnce() -> anyhow::Result<Arc<Avatar>>,
    params: &dyn Fn(usize) -> BodyParams,
    quick: bool,
) -> anyhow::Result<Vec<Row>> {
    let Some(gpu) = card() else {
        return Ok(Vec::new());
    };
    let mut avatars = vec![Arc::clone(own)];
    if !quick {
        avatars.push(fine()?);
    }
    let mut rows = Vec::new();
    for avatar in avatars {
        if interrupt::requested() {
            break;
        }
        match rows_of(&gpu, &avatar, params, quick) {
            Ok(more) => rows.extend(more),
            Err(reason) => eprintln!("effigy: no more rows about a graphics card: {reason}"),
        }
    }
    Ok(rows)
}

/// One avatar in poses that `params` numbers.
fn rows_of(
    gpu: &Arc<Gpu>,
    avatar: &Arc<Avatar>,
    params: &dyn Fn(usize) -> BodyParams,
    quick: bool,
) -> Result<Vec<Row>, GpuError> {
    let mut cpu = Driver::new(Arc::clone(avatar), DriveConfig::default());
    let mut card = GpuDriver::new(gpu, &cpu)?;
    let mut differences_mm = Vec::new();
    let (compared, rounds) = match (gpu.is_software(), quick) {
        (true, true) => (1, 1),
        (true, false) => (IN_SOFTWARE, IN_SOFTWARE),
        (false, true) => (COMPARED, COMPARED),
        (false, false) => (COMPARED, ROUNDS),
    };
    for number in 0..compared {
        let params = params(number * FRAMES_APART);
        let ours = card.pose(&params, FrameId(0))?.vertices;
        let twins = cpu.pose(&params, FrameId(0)).vertices;
        let pairs = ours.iter().zip(&twins);
        differences_mm.extend(pairs.map(|(a, b)| f64::from(a.distance(*b)) * 1e3));
    }
    differences_mm.sort_by(f64::total_cmp);
    let (mut a, mut b) = (0, 0);
    let mut failed = Ok(());
    let [by_cpu, by_card] = in_turn(
        rounds,
        [
            &mut || {
                cpu.pose(&params(a), FrameId(0));
                a += 1;
            },
            &mut || {
                let posed = card.pose(&params(b), FrameId(0)).map(drop);
                if failed.is_ok() {
                    failed = posed;
                }
                b += 1;
            },
        ],
    );
    failed?;
    let vertices = avatar.topology.vertices_in_unit.len();
    let name = format!("drive on {}{}, {vertices} vertices", gpu.name(), kind(gpu));
    let off = |share: usize| differences_mm[(differences_mm.len() - 1) * share / 100];
    Ok(vec![
        Row::new(name.clone(), by_card.recip(), "poses/s")
            .against("the processor's full field", by_cpu / by_card),
        Row::new(format!("{name}, off the processor's, p95"), off(95), "mm"),
        Row::new(
            format!("{name}, off the processor's, largest"),
            off(100),
            "mm",
        ),
    ])
}
