//! What simulated clothes are judged by: depth inside the body, strain, and how much they change.

use effigy_fusion::mesh::closest_point::ClosestPoint;
use glam::Vec3;

use super::wear::Wear;

impl Wear {
    /// How far outside the minimal body each point of every garment is, in metres; negative inside.
    pub fn clearances_m(&self) -> Vec<f32> {
        let person = self.person();
        let posed = person.minimal_posed(&self.pose().theta, self.pose().trans);
        let tree = ClosestPoint::new(&posed.vertices, &person.body.triangles)
            .expect("a posed body is finite");
        self.points()
            .flatten()
            .map(|&point| tree.signed_distance(point))
            .collect()
    }

    /// For every point of every garment, how it lies from the body's vertex it was cut over, in star pose.
    pub fn offsets_in_star_pose_m(&self) -> Vec<Vec3> {
        let minimal = self.person().minimal_canonical(&self.pose().theta);
        let garments = self.garments().iter().zip(self.points());
        garments
            .flat_map(|(garment, points)| {
                let lying = self.in_star_pose(points, &garment.weights);
                let homes = garment.home.iter().map(|&v| minimal[v as usize]);
                lying
                    .into_iter()
                    .zip(homes)
                    .map(|(point, home)| point - home)
                    .collect::<Vec<_>>()
            })
            .collect()
    }
}

/// Points deeper inside the body than this, and edges longer or shorter by more than this share, are counted.
const DEEP_M: f32 = 0.002;
const STRAINED: f32 = 0.15;

/// How well clothes behaved over a number of frames.
#[derive(Clone, Copy, Debug, Default)]
pub struct Behaviour {
    edges: u64,
    strained: u64,
    points: u64,
    deep: u64,
}

impl Behaviour {
    /// Counts a frame's strained edges.
    pub fn add_strains(&mut self, wear: &Wear) {
        for strain in wear.strains() {
            self.edges += 1;
            self.strained += u64::from(strain.abs() > STRAINED);
        }
    }

    /// Counts a frame's points inside the body, from [`Wear::clearances_m`].
    pub fn add_clearances(&mut self, clearances_m: &[f32]) {
        for clearance_m in clearances_m {
            self.points += 1;
            self.deep += u64::from(*clearance_m < -DEEP_M);
        }
    }

    /// Share of all edges that were strained, 0 to 1.
    pub fn strained_share(&self) -> f32 {
        (self.strained as f64 / self.edges.max(1) as f64) as f32
    }

    /// Share of all points that were deep inside the body, 0 to 1.
    pub fn deep_share(&self) -> f32 {
        (self.deep as f64 / self.points.max(1) as f64) as f32
    }
}

/// How far each point strays from its mean over frames, root mean square.
pub fn strays_m(frames: &[Vec<Vec3>]) -> Vec<f32> {
    let count = frames.len().max(1) as f32;
    let points = frames.first().map_or(0, Vec::len);
    (0..points)
        .map(|v| {
            let mean = frames.iter().map(|frame| frame[v]).sum::<Vec3>() / count;
            let squares = frames.iter().map(|frame| frame[v].distance_squared(mean));
            (squares.sum::<f32>() / count).sqrt()
        })
        .collect()
}

/// Root mean square of the distances between two states of the same points.
pub fn rms_between_m(a: &[Vec3], b: &[Vec3]) -> f32 {
    let squares: f32 = a.iter().zip(b).map(|(a, b)| a.distance_squared(*b)).sum();
    (squares / a.len().max(1) as f32).sqrt()
}
