//! Variants timed in turn: what else the machine does meets them all alike.

use crate::pipeline::clock::Clock;

/// Median seconds of each step over so many rounds, all steps once a round; a round before them warms caches.
pub(super) fn in_turn<const N: usize>(rounds: usize, mut steps: [&mut dyn FnMut(); N]) -> [f64; N] {
    let clock = Clock::start();
    let mut secs = [(); N].map(|()| Vec::with_capacity(rounds));
    for round in 0..=rounds {
        for (step, secs) in steps.iter_mut().zip(&mut secs) {
            let start = clock.secs();
            step();
            if round > 0 {
                secs.push(clock.secs() - start);
            }
        }
    }
    secs.map(|mut secs| {
        secs.sort_by(f64::total_cmp);
        secs[secs.len() / 2]
    })
}
