//! The control cage: rings of measured points, sewn into one closed surface of mostly four-sided faces.

use glam::{Vec3, vec3};

use super::figures::{self as f, Figure};

/// Lowers the body from soles at zero to SMPL's rest space, whose origin lies a little above the pelvis.
pub(super) const SOLES_Y_M: f32 = -1.2;

/// Control points and polygons, counter-clockwise seen from outside.
#[derive(Clone, Debug, Default)]
pub(super) struct Cage {
    pub(super) points: Vec<Vec3>,
    pub(super) faces: Vec<Vec<u32>>,
    /// 1 for points of the arms (from the deltoid on), else 0.
    pub(super) arm: Vec<f32>,
    /// The point on the other side; points on the midline are their own.
    pub(super) mirror: Vec<u32>,
}

type Ring = Vec<u32>;

/// The whole cage: the left half as sewn from the figures, and its mirror image.
pub(super) fn cage() -> Cage {
    let mut half = Cage::default();
    let trunk = half.trunk();
    half.head(&trunk.shoulders);
    let wrist = half.arm(&trunk.arm_hole);
    half.hand(&wrist);
    let ankle = half.leg(&trunk.leg_hole);
    half.foot(&ankle);
    half.with_mirror_image()
}

struct Trunk {
    shoulders: Ring,
    arm_hole: Ring,
    leg_hole: Ring,
}

impl Cage {
    fn trunk(&mut self) -> Trunk {
        let [seat, hips, waist, ribs] =
            [f::SEAT, f::HIPS, f::WAIST, f::RIBS].map(|ring| self.ring(&ring));
        let crotch = self.ring(&f::CROTCH)[0];
        let [chest, shoulders] = [f::CHEST, f::SHOULDERS].map(|ring| self.ring(&ring));
        let breast = self.ring(&f::BREAST);
        for (below, above) in [
            (&seat, &hips),
            (&hips, &waist),
            (&waist, &ribs),
            (&ribs, &chest),
        ] {
            self.band(below, above);
        }
        // The front and back of the chest beside the hole of the arm.
        self.band(&chest[..3], &breast[..3]);
        self.band(&breast[..3], &shoulders[..3]);
        self.band(&chest[4..], &breast[3..]);
        self.band(&breast[3..], &shoulders[4..]);
        let arm_hole = vec![
            chest[3],
            chest[2],
            breast[2],
            shoulders[2],
            shoulders[3],
            shoulders[4],
            breast[3],
            chest[4],
        ];
        let mut leg_hole = seat;
        leg_hole.push(crotch);
        Trunk { shoulders, arm_hole, leg_hole }
    }

    fn head(&mut self, shoulders: &[u32]) {
        let mut below = shoulders.to_vec();
        for figures in [
            &f::NECK,
            &f::JAW,
            &f::CHIN,
            &f::MOUTH,
            &f::LIP,
            &f::NOSE,
            &f::EYES,
            &f::BROW,
            &f::CROWN,
        ] {
            let ring = self.ring(figures);
            self.band(&below, &ring);
            below = ring;
        }
        let [a, b, c, d, e, g, h] = std::array::from_fn(|i| below[i]);
        self.faces
            .extend([vec![a, b, g, h], vec![b, c, e, g], vec![c, d, e]]);
    }

    fn arm(&mut self, hole: &[u32]) -> Ring {
        let first = self.points.len();
        let rings = [
            &f::DELTOID,
            &f::UPPER_ARM,
            &f::ABOVE_ELBOW,
            &f::BELOW_ELBOW,
            &f::FOREARM,
            &f::WRIST,
        ];
        let wrist = rings.into_iter().fold(hole.to_vec(), |inner, figures| {
            let outer = self.ring(figures);
            self.tube(&inner, &outer, &[]);
            outer
        });
        self.arm[first..].fill(1.0);
        wrist
    }

    fn hand(&mut self, wrist: &[u32]) {
        let first = self.points.len();
        let palm = self.ring(&f::PALM);
        let knuckles = self.ring(&f::KNUCKLES);
        self.tube(wrist, &palm, &[1, 2]);
        self.tube(&palm, &knuckles, &[]);
        let thumb_root = [wrist[3], palm[3], palm[2], palm[1], wrist[1], wrist[2]];
        let thumb = self.ring(&f::THUMB);
        self.tube(&thumb_root, &thumb, &[]);
        self.cap_six(&thumb);
        // The hand ends in four faces side by side: each grows a finger.
        let fingers: [(&[usize], &[Figure]); 4] = [
            (&[1, 2, 3], &f::INDEX),
            (&[0, 1, 3, 4], &f::MIDDLE),
            (&[7, 0, 4, 5], &f::RING),
            (&[7, 5, 6], &f::LITTLE),
        ];
        for (roots, figures) in fingers {
            let root: Ring = roots.iter().map(|&i| knuckles[i]).collect();
            let tip = self.ring(figures);
            self.tube(&root, &tip, &[]);
            self.faces.push(tip.into_iter().rev().collect());
        }
        self.arm[first..].fill(1.0);
    }

    fn leg(&mut self, hole: &[u32]) -> Ring {
        let rings = [
            &f::THIGH_TOP,
            &f::THIGH,
            &f::ABOVE_KNEE,
            &f::BELOW_KNEE,
            &f::CALF,
            &f::ANKLE,
        ];
        rings.into_iter().fold(hole.to_vec(), |above, figures| {
            let below = self.ring(figures);
            self.band(&closed(&below), &closed(&above));
            below
        })
    }

    fn foot(&mut self, ankle: &[u32]) {
        let heel = self.ring(&f::HEEL);
        let sole = self.ring(&f::SOLE)[0];
        self.band(&closed(&heel)[2..], &closed(ankle)[2..]);
        self.faces.extend([
            vec![heel[7], sole, heel[1], heel[0]],
            vec![sole, heel[3], heel[2], heel[1]],
            vec![heel[6], heel[5], sole, heel[7]],
            vec![heel[5], heel[4], heel[3], sole],
        ]);
        let front = [ankle[0], ankle[1], ankle[2], heel[2], heel[1], heel[0]];
        let instep = self.ring(&f::INSTEP);
        let toes = self.ring(&f::TOES);
        self.tube(&front, &instep, &[]);
        self.tube(&instep, &toes, &[]);
        self.cap_six(&toes);
    }

    fn ring(&mut self, figures: &[Figure]) -> Ring {
        let first = self.points.len() as u32;
        for &[x, y, z] in figures {
            let point = vec3(f32::from(x), f32::from(y), f32::from(z)) * 1e-3;
            self.points.push(point + vec3(0.0, SOLES_Y_M, 0.0));
            self.arm.push(0.0);
        }
        (first..self.points.len() as u32).collect()
    }

    /// Faces between two open rows of points that run from front to left.
    fn band(&mut self, below: &[u32], above: &[u32]) {
        for (low, high) in below.windows(2).zip(above.windows(2)) {
            self.faces.push(vec![low[0], low[1], high[1], high[0]]);
        }
    }

    /// Faces between two closed rings, of which the second lies outwards; some may be left open.
    fn tube(&mut self, inner: &[u32], outer: &[u32], open: &[usize]) {
        let (inner, outer) = (closed(inner), closed(outer));
        for i in (0..inner.len() - 1).filter(|i| !open.contains(i)) {
            self.faces
                .push(vec![inner[i], outer[i], outer[i + 1], inner[i + 1]]);
        }
    }

    fn cap_six(&mut self, ring: &[u32]) {
        self.faces.push(vec![ring[5], ring[4], ring[1], ring[0]]);
        self.faces.push(vec![ring[4], ring[3], ring[2], ring[1]]);
    }

    fn with_mirror_image(mut self) -> Self {
        let half_points = self.points.len();
        self.mirror = vec![0; half_points];
        for i in 0..half_points {
            if self.points[i].x == 0.0 {
                self.mirror[i] = i as u32;
                continue;
            }
            self.mirror[i] = self.points.len() as u32;
            self.mirror.push(i as u32);
            self.points.push(self.points[i] * vec3(-1.0, 1.0, 1.0));
            self.arm.push(self.arm[i]);
        }
        for face in self.faces.clone() {
            let mirrored = face
                .iter()
                .rev()
                .map(|&i| self.mirror[i as usize])
                .collect();
            self.faces.push(mirrored);
        }
        self
    }
}

/// The ring with its first point repeated at the end.
fn closed(ring: &[u32]) -> Ring {
    ring.iter().chain(ring.first()).copied().collect()
}
