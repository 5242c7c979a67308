//! Where each vertex of a body lies, in words a tailor uses: how far down the arm or leg, how high on the
//! trunk. Made from joints and skinning weights, so that it holds for any body of SMPL's structure.

use effigy_fusion::mesh::normals::vertex_normals;
use effigy_registration::smpl::{BodyModel, JOINT_COUNT};
use glam::Vec3;

/// One vertex of the zero-pose body, in tailor's terms.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// 0 for the body's left, 1 for its right.
    pub(crate) side: usize,
    /// Along the arm: 0 shoulder, 1 elbow, 2 wrist; negative on the trunk.
    pub(crate) arm: f32,
    /// Down the leg: 0 hip, 1 knee, 2 ankle; negative above the hips.
    pub(crate) leg: f32,
    /// Up the trunk: 0 pelvis, 1 neck.
    pub(crate) trunk: f32,
    /// Shares of skinning.
    pub(crate) head_share: f32,
    pub(crate) arm_share: f32,
    pub(crate) leg_share: f32,
    pub(crate) foot_share: f32,
}

/// A body in the zero pose, charted.
#[derive(Clone, Debug)]
pub(crate) struct Chart {
    pub(crate) vertices: Vec<Vec3>,
    pub(crate) normals: Vec<Vec3>,
    /// Normals of a smoothed surface: what loose cloth sees of the body.
    pub(crate) smooth_normals: Vec<Vec3>,
    /// How far the smoothed surface lies outside: hollows that cloth spans. At least 0, metres.
    pub(crate) hollow_m: Vec<f32>,
    pub(crate) joints: [Vec3; JOINT_COUNT],
    pub(crate) places: Vec<Place>,
    /// The lowest point of each foot, and the top of the head.
    pub(crate) sole_y: [f32; 2],
    pub(crate) head_top_y: f32,
}

impl Chart {
    pub(crate) fn new(body: &BodyModel, vertices: Vec<Vec3>, joints: &[Vec3; JOINT_COUNT]) -> Self {
        let normals = vertex_normals(&vertices, &body.triangles);
        let neighbours = Neighbours::of(vertices.len(), &body.triangles);
        let smoothed = neighbours.smoothed(&vertices, 14);
        let smooth_normals = vertex_normals(&smoothed, &body.triangles);
        let wide = neighbours.smoothed(&vertices, 40);
        let hollow_m = (0..vertices.len())
            .map(|v| (wide[v] - vertices[v]).dot(normals[v]).clamp(0.0, 0.03))
            .collect();
        let places: Vec<Place> = (0..vertices.len())
            .map(|v| Place::of(body, v, vertices[v], joints))
            .collect();
        let heights = |of: &dyn Fn(&Place) -> bool| -> Vec<f32> {
            let chosen = vertices.iter().zip(&places).filter(|(_, place)| of(place));
            chosen.map(|(vertex, _)| vertex.y).collect()
        };
        let lowest = |side| {
            let feet = heights(&|place| place.side == side && place.foot_share > 0.5);
            feet.into_iter().fold(f32::MAX, f32::min)
        };
        let sole_y = [lowest(0), lowest(1)];
        let head_top_y = heights(&|place| place.head_share > 0.5)
            .into_iter()
            .fold(f32::MIN, f32::max);
        Self {
            vertices,
            normals,
            smooth_normals,
            hollow_m,
            joints: *joints,
            places,
            sole_y,
            head_top_y,
        }
    }
}

impl Place {
    fn of(body: &BodyModel, index: usize, vertex: Vec3, joints: &[Vec3; JOINT_COUNT]) -> Self {
        let skinning = &body.skinning[index];
        let mut shares = [0.0; JOINT_COUNT];
        for (&bone, &weight) in skinning.bones.iter().zip(&skinning.weights) {
            shares[bone as usize] += weight;
        }
        let sum = |bones: &[usize]| bones.iter().map(|&b| shares[b]).sum::<f32>();
        let side = usize::from(vertex.x < joints[0].x);
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let out = |joint: usize| (joints[joint + side].x - joints[0].x) * sign;
        let x = (vertex.x - joints[0].x) * sign;
        let y = |joint: usize| joints[joint + side].y;
        Self {
            side,
            arm: piecewise(x, [out(16), out(18), out(20)]),
            leg: piecewise(-vertex.y, [-y(1), -y(4), -y(7)]),
            trunk: (vertex.y - joints[0].y) / (joints[12].y - joints[0].y).max(0.1),
            head_share: sum(&[12, 15]),
            arm_share: sum(&[16, 17, 18, 19, 20, 21, 22, 23]),
            leg_share: sum(&[1, 2, 4, 5, 7, 8, 10, 11]),
            foot_share: sum(&[7, 8, 10, 11]),
        }
    }
}

/// 0, 1, 2 at the three stations, straight between and beyond.
fn piecewise(x: f32, [a, b, c]: [f32; 3]) -> f32 {
    if x < b {
        (x - a) / (b - a).max(1e-3)
    } else {
        1.0 + (x - b) / (c - b).max(1e-3)
    }
}

/// Who shares an edge with whom.
struct Neighbours {
    starts: Vec<u32>,
    others: Vec<u32>,
}

impl Neighbours {
    fn of(vertex_count: usize, triangles: &[[u32; 3]]) -> Self {
        let mut edges: Vec<(u32, u32)> = triangles
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, a), (b, c), (c, b), (c, a), (a, c)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let mut starts = vec![0u32; vertex_count + 1];
        for &(from, _) in &edges {
            starts[from as usize + 1] += 1;
        }
        for v in 0..vertex_count {
            starts[v + 1] += starts[v];
        }
        Self { starts, others: edges.into_iter().map(|(_, to)| to).collect() }
    }

    fn smoothed(&self, vertices: &[Vec3], rounds: usize) -> Vec<Vec3> {
        let mut current = vertices.to_vec();
        for _ in 0..rounds {
            current = (0..current.len())
                .map(|v| {
                    let around = &self.others[self.starts[v] as usize..self.starts[v + 1] as usize];
                    if around.is_empty() {
                        return current[v];
                    }
                    let sum: Vec3 = around.iter().map(|&o| current[o as usize]).sum();
                    current[v].lerp(sum / around.len() as f32, 0.5)
                })
                .collect();
        }
        current
    }
}
