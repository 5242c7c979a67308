//! `effigy import`: other people's recordings become ours.

use std::collections::BTreeMap;

use effigy_capture::{FrameSource as _, import::tum::TumFolder, recording::RecordingWriter};

use crate::{
    cli::{ImportArgs, ImportKind},
    interrupt::{self, Stopped},
    progress::Progress,
    say::say,
};

pub(crate) fn run(args: &ImportArgs) -> anyhow::Result<()> {
    let mut source = match args.kind {
        ImportKind::Tum => TumFolder::open(&args.input)?,
    };
    let metadata = BTreeMap::from([("effigy.imported_from".to_owned(), source.name())]);
    let writer = RecordingWriter::create(&args.out, source.calibration(), &metadata)?;
    let progress = Progress::new("importing", source.frame_count());
    let mut done = 0;
    while !interrupt::requested() {
        let Some(frame) = source.next_frame()? else {
            break;
        };
        writer.push_blocking(&frame)?;
        done += 1;
        progress.advance(done);
    }
    progress.finish();
    let summary = writer.finish()?;
    if interrupt::requested() {
        return Err(Stopped::short(&args.out, summary.frames).into());
    }
    say!("{}: {} frames", args.out.display(), summary.frames);
    Ok(())
}
