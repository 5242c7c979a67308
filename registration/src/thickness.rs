//! How thick somebody's clothes are, from how much depth scatters about the body.
//!
//! Girth explains an even layer of cloth as well as cloth does: the fit makes the mean distance between body and depth
//! what it was told to expect, whatever that is. What no shape explains away is scatter: cloth touches the skin here and
//! stands off there, the farther the looser it is. If distances were spread exponentially their mean would be their
//! deviation; cloth that hangs is nearly so, cloth with ease all around stands off by more.

use crate::{
    residual::Match,
    surface::{PosedSurface, REGION_COUNT},
};

/// Mean distance over deviation, chosen on people 104 and 105 (who are in no suite). Of 4, 10 and 18 mm the best for a
/// deviation of 5.0 mm was 10 (clothes that are offsets of the skin) and for one of 6.0 it was 4, 10 nearly as good (a
/// simulated T-shirt and trousers); where it was 2.2, close-fitting, 10 mm were too many by far.
const MEAN_OF_DEVIATION: f32 = 2.1;
/// What is believed at least and at most.
const THINNEST_M: f32 = 0.002;
const THICKEST_M: f32 = 0.012;
/// Noisier depth scatters by itself more than clothes do: a D435 at 2 m by 16 mm in tight ones and in loose ones.
const QUIET_M: f32 = 0.006;
/// Fewer distances say nothing of a region, or of the whole.
const ENOUGH_OF_REGION: usize = 60;
const ENOUGH: usize = 200;
/// The quartiles are so many deviations apart, halfway between a normal spread (1.35) and an exponential one (1.10).
const QUARTILES_APART: f32 = 1.2;

/// Signed distances from clothed parts of fitted bodies to the depth that was matched with them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scatter {
    distances_m: [Vec<f32>; REGION_COUNT],
    /// Sum of the depth's variance over all distances.
    noise_m2: f64,
}

impl Scatter {
    /// Adds what one frame shows.
    pub(crate) fn add(&mut self, body: &PosedSurface<'_>, matches: &[Match]) {
        /// Less of the vertex is covered: hands, head.
        const CLOTHED: f32 = 0.9;
        let surface = &body.shaped.surface;
        for found in matches {
            let vertex = found.vertex as usize;
            if surface.clothed[vertex] < CLOTHED || surface.spanned[vertex] {
                continue;
            }
            let off_m = found.point - body.vertices[vertex];
            self.distances_m[surface.region[vertex] as usize].push(found.normal.dot(off_m));
            self.noise_m2 += f64::from(found.sigma_m * found.sigma_m);
        }
    }

    /// The mean distance of the clothes off the skin in each region, of what is hardly seen as everywhere; `None` where too
    /// little was seen, or nothing but noise.
    pub(crate) fn thickness_m(self) -> Option<[f32; REGION_COUNT]> {
        let mut all = self.distances_m.concat();
        let noise_m2 = (self.noise_m2 / all.len().max(1) as f64) as f32;
        if all.len() < ENOUGH || noise_m2 > QUIET_M * QUIET_M {
            return None;
        }
        let everywhere_m = thickness_m(&mut all);
        let by_region_m = self.distances_m.map(|mut distances_m| {
            if distances_m.len() < ENOUGH_OF_REGION {
                everywhere_m
            } else {
                thickness_m(&mut distances_m)
            }
        });
        tracing::debug!(everywhere_m, ?by_region_m, "clothes stand off");
        Some(by_region_m)
    }
}

/// From how much the distances scatter.
fn thickness_m(distances_m: &mut [f32]) -> f32 {
    distances_m.sort_unstable_by(f32::total_cmp);
    let at = |share: f32| distances_m[((distances_m.len() - 1) as f32 * share) as usize];
    let deviation_m = (at(0.75) - at(0.25)) / QUARTILES_APART;
    tracing::debug!(
        count = distances_m.len(),
        deviation_m,
        median_m = at(0.5),
        "scatter"
    );
    (MEAN_OF_DEVIATION * deviation_m).clamp(THINNEST_M, THICKEST_M)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{residual::checker, surface::Region};

    /// What is learned of clothes that stand off the skin by `off_m(0..1)`, evenly over all places.
    fn learned(off_m: impl Fn(f32) -> f32, sigma_m: f32) -> Option<[f32; REGION_COUNT]> {
        let shaped = checker::test_surface();
        let body = PosedSurface::new(&shaped, &checker::test_state());
        let count = body.vertices.len();
        let places = (0..4 * count).map(|place| {
            let vertex = place % count;
            let share = (place as f32 * 0.618_034).fract();
            Match {
                vertex: vertex as u32,
                point: body.vertices[vertex] + body.normals[vertex] * off_m(share),
                normal: body.normals[vertex],
                sigma_m,
                trust: 1.0,
            }
        });
        let mut scatter = Scatter::default();
        scatter.add(&body, &places.collect::<Vec<_>>());
        scatter.thickness_m()
    }

    #[test]
    fn loose_clothes_scatter_and_girth_does_not() {
        // As far off the skin as the fit believes, on average; spread exponentially about that.
        let spread = |mean_m: f32| move |share: f32| 0.01 - mean_m * (1.0 - share).ln();
        let [tight, loose] =
            [0.002, 0.008].map(|mean_m| learned(spread(mean_m), 0.003).expect("enough is seen"));
        for (tight, loose) in tight.into_iter().zip(loose) {
            assert!(tight < 0.005 && loose > 0.009, "{tight} {loose}");
        }
        assert_eq!(learned(|_| 0.03, 0.003), Some([THINNEST_M; REGION_COUNT]));
    }

    #[test]
    fn bare_forearms_are_told_from_a_loose_trunk() {
        let shaped = checker::test_surface();
        let body = PosedSurface::new(&shaped, &checker::test_state());
        let surface = &shaped.surface;
        let mut matches = Vec::new();
        for place in 0..6 * body.vertices.len() {
            let vertex = place % body.vertices.len();
            let share = (place as f32 * 0.618_034).fract();
            let off_m = if surface.region[vertex] == Region::Forearms {
                0.002
            } else {
                0.02
            };
            matches.push(Match {
                vertex: vertex as u32,
                point: body.vertices[vertex] + body.normals[vertex] * (off_m * share),
                normal: body.normals[vertex],
                sigma_m: 0.001,
                trust: 1.0,
            });
        }
        let mut scatter = Scatter::default();
        scatter.add(&body, &matches);
        let [trunk, _, forearms, ..] = scatter.thickness_m().expect("enough is seen");
        assert!(forearms < 0.003 && trunk > 0.01, "{trunk} {forearms}");
    }

    #[test]
    fn noise_says_nothing_of_clothes() {
        assert_eq!(learned(|share| 0.04 * share, 0.02), None);
        assert_eq!(Scatter::default().thickness_m(), None);
    }
}
