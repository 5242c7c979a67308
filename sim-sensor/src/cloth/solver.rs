//! Cloth as points joined by constraints, moved by extended position-based dynamics
//! (Macklin, Müller and Chentanez, *XPBD*, MIG 2016; *Small steps in physics simulation*, SCA 2019).

use glam::Vec3;

use super::{
    collider::{Arm, Obstacle, REACH_M, Touch},
    hold::Held,
    sew::Garment,
    sheet::{Edge, NONE},
    sleeve::{ArmAxes, Ring},
};

const GRAVITY: Vec3 = Vec3::new(0.0, -9.81, 0.0);
/// Nothing in a wardrobe is faster.
const MAX_SPEED_M_S: f32 = 12.0;
/// Cloth lies this high on the floor.
const ON_FLOOR_M: f32 = 0.002;
/// Contacts are kept ready this far beyond touching.
const MARGIN_M: f32 = 0.004;
/// The furthest that anything but its own arm pushes a sleeve in one step.
const SLEEVE_PUSH_M: f32 = 0.003;
/// What each step ends with: rounds, and the share by which an edge may be longer or shorter then.
const STRAIN_ROUNDS: usize = 6;
const STRAIN_LIMIT: f32 = 0.08;
/// Cloth on cloth moves along with it, by this share in each step.
const LAYER_CLING: f32 = 0.1;
/// Edges bent more than this in the rest shape are folds that stay.
const CREASE_COSINE: f32 = 0.8;
/// Folds that stay are this much stiffer.
const CREASE_STIFFNESS: f32 = 30.0;

/// One garment's moving state.
#[derive(Clone, Debug)]
pub(super) struct Cloth {
    pub(super) points: Vec<Vec3>,
    pub(super) velocities: Vec<Vec3>,
    before: Vec<Vec3>,
    stretches: Vec<Stretch>,
    bends: Vec<Bend>,
    pub(super) held: Vec<Held>,
    /// Where what is held should be at the end of the step.
    pub(super) anchors: Vec<Vec3>,
    contacts: Vec<Contact>,
    /// For each obstacle and point.
    searches: Vec<Vec<Search>>,
    /// The arm that each point is around.
    sleeves: Vec<Option<Arm>>,
    rings: Vec<Ring>,
    /// Where arms are at the end of the step.
    pub(super) arm_axes: ArmAxes,
    /// The height of the floor.
    pub(super) floor_m: f32,
    /// What touches its own arm; nothing else of the body pushes it.
    on_arm: Vec<bool>,
    friction: f32,
    drag: f32,
}

/// Keeps an edge's length.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    ends: [u32; 2],
    rest_m: f32,
    compliance: f32,
    lambda: f32,
}

/// Keeps two triangles flat, or folded as they were cut: `|sum shares * points| = rest_m`
/// (the discrete bending of Bergou et al., *A quadratic bending model*, SGP 2006).
#[derive(Clone, Copy, Debug)]
struct Bend {
    points: [u32; 4],
    shares: [f32; 4],
    rest_m: f32,
    compliance: f32,
    lambda: f32,
}

/// What is known about a surface near a point.
#[derive(Clone, Copy, Debug)]
struct Search {
    /// The triangle found last.
    hint: u32,
    /// The surface is at least this far away.
    clear_m: f32,
    /// Where the point and how far the surface was then.
    from: Vec3,
    travel_m: f32,
}

impl Search {
    const NEVER: Self = Self { hint: NONE, clear_m: 0.0, from: Vec3::ZERO, travel_m: 0.0 };
}

/// A point that must stay on its side of a plane.
#[derive(Clone, Copy, Debug)]
struct Contact {
    point: u32,
    normal: Vec3,
    offset_m: f32,
    moved: Vec3,
    pushed_m: f32,
    /// What was touched, and where; a garment has a number.
    layer: Option<usize>,
    triangle: u32,
    barycentric: Vec3,
}

impl Cloth {
    /// A garment at rest; each of its edges is longer by a factor than it was cut.
    pub(super) fn new(garment: &Garment, let_out: &[f32]) -> Self {
        let points = garment.rest.points.clone();
        let fabric = &garment.pattern.fabric;
        let at = |v: u32| points[v as usize];
        let edges = garment.rest.edges();
        // From top to bottom: what hangs is carried by what was just settled.
        let mut downwards: Vec<_> = edges.iter().zip(let_out).collect();
        downwards.sort_by(|(e, _), (f, _)| {
            let height = |edge: &Edge| at(edge.ends[0]).y + at(edge.ends[1]).y;
            height(f).total_cmp(&height(e))
        });
        let stretches = downwards
            .iter()
            .map(|&(edge, &let_out)| Stretch {
                ends: edge.ends,
                rest_m: let_out * at(edge.ends[0]).distance(at(edge.ends[1])),
                compliance: fabric.stretch_compliance,
                lambda: 0.0,
            })
            .collect();
        let bends = edges
            .iter()
            .filter(|edge| !edge.is_border())
            .map(|edge| {
                let [a, b] = edge.ends;
                let [c, d] = edge.opposite;
                Bend::new([a, b, c, d], [a, b, c, d].map(at), fabric.bend_compliance)
            })
            .collect();
        Self {
            velocities: vec![Vec3::ZERO; points.len()],
            before: points.clone(),
            points,
            stretches,
            bends,
            anchors: vec![Vec3::ZERO; garment.held.len()],
            held: garment.held.clone(),
            contacts: Vec::new(),
            searches: Vec::new(),
            sleeves: garment.arms.clone(),
            rings: garment.rings.clone(),
            arm_axes: [[Vec3::ZERO; 4]; 2],
            floor_m: f32::NEG_INFINITY,
            on_arm: Vec::new(),
            friction: fabric.friction,
            drag: fabric.drag,
        }
    }

    /// Forgets where searches ended, so that a state needs positions and velocities only.
    pub(super) fn forget_searches(&mut self, obstacles: usize) {
        self.searches.resize(obstacles, Vec::new());
        for searches in &mut self.searches {
            searches.clear();
            searches.resize(self.points.len(), Search::NEVER);
        }
    }

    /// Moves by one small step; arms come before the body, the body before garments.
    pub(super) fn step(&mut self, secs: f32, iterations: usize, obstacles: &[Obstacle<'_>]) {
        let kept = (1.0 - self.drag * secs).max(0.0);
        for v in 0..self.points.len() {
            let velocity = self.velocities[v] * kept + GRAVITY * secs;
            self.before[v] = self.points[v];
            self.points[v] += velocity.clamp_length_max(MAX_SPEED_M_S) * secs;
        }
        self.find_contacts(obstacles);
        for stretch in &mut self.stretches {
            stretch.lambda = 0.0;
        }
        for bend in &mut self.bends {
            bend.lambda = 0.0;
        }
        let per_square = (secs * secs).recip();
        for iteration in 0..iterations {
            for bend in &mut self.bends {
                bend.solve(&mut self.points, per_square);
            }
            // Both ways in turn: a pull then runs through the whole garment from either end.
            if iteration % 2 == 0 {
                for stretch in &mut self.stretches {
                    stretch.solve(&mut self.points, per_square);
                }
            } else {
                for stretch in self.stretches.iter_mut().rev() {
                    stretch.solve(&mut self.points, per_square);
                }
            }
            self.hold(per_square);
            for ring in &self.rings {
                ring.hold(&mut self.points, &self.arm_axes);
            }
            for contact in &mut self.contacts {
                contact.push(&mut self.points);
            }
        }
        self.limit_strain();
        self.rub();
        for v in 0..self.points.len() {
            self.velocities[v] = (self.points[v] - self.before[v]) / secs;
        }
        // Nothing bounces off: being pushed out of a surface is no reason to fly away from it.
        for contact in self
            .contacts
            .iter()
            .filter(|contact| contact.pushed_m > 0.0)
        {
            let velocity = &mut self.velocities[contact.point as usize];
            let away = (*velocity - contact.moved / secs).dot(contact.normal);
            *velocity -= contact.normal * away.max(0.0);
            if contact.layer.is_some() {
                *velocity = velocity.lerp(contact.moved / secs, LAYER_CLING);
            }
        }
    }

    /// How the last step pushed garments underneath: which one, at which triangle, and by how much.
    pub(super) fn reactions(&self) -> impl Iterator<Item = (usize, u32, Vec3, Vec3)> + '_ {
        let pushing = self
            .contacts
            .iter()
            .filter(|contact| contact.pushed_m > 0.0);
        pushing.filter_map(|c| Some((c.layer?, c.triangle, c.barycentric, -c.normal * c.pushed_m)))
    }

    /// Where every point is outside of everything, without a push that would move it on.
    pub(super) fn push_out(&mut self, obstacles: &[Obstacle<'_>]) {
        for _ in 0..2 {
            self.find_contacts(obstacles);
            for contact in &mut self.contacts {
                contact.push(&mut self.points);
            }
        }
    }

    fn find_contacts(&mut self, obstacles: &[Obstacle<'_>]) {
        self.contacts.clear();
        self.on_arm.clear();
        self.on_arm.resize(self.points.len(), false);
        self.find_floor();
        for (obstacle, searches) in obstacles.iter().zip(&mut self.searches) {
            let near_m = obstacle.thickness_m + MARGIN_M;
            for (v, &point) in self.points.iter().enumerate() {
                let is_for = match (obstacle.sleeve, obstacle.layer) {
                    (Some(arm), _) => self.sleeves[v] == Some(arm),
                    (None, None) => !self.on_arm[v],
                    (None, Some(_)) => true,
                };
                if !is_for {
                    continue;
                }
                let search = &mut searches[v];
                // Far enough away last time, and neither has moved enough since.
                let travel_m = obstacle.collider.travel_m;
                let moved_m = point.distance(search.from) + travel_m - search.travel_m;
                if search.clear_m - moved_m > near_m {
                    continue;
                }
                let touch = obstacle.collider.nearest(point, REACH_M, search.hint);
                *search = Search {
                    hint: touch.map_or(search.hint, |touch| touch.triangle),
                    clear_m: touch.map_or(REACH_M, |touch| touch.distance_m.max(0.0)),
                    from: point,
                    travel_m,
                };
                let touches = |touch: &Touch| {
                    let within = -obstacle.deepest_m..=near_m;
                    within.contains(&touch.distance_m) && !touch.on_rim
                };
                let Some(touch) = touch.filter(touches) else {
                    continue;
                };
                self.on_arm[v] |= obstacle.sleeve.is_some();
                // What the trunk pushes goes no further than its arm can stop it.
                let push_m = match (self.sleeves[v], obstacle.sleeve) {
                    (Some(_), None) => obstacle.push_m.min(SLEEVE_PUSH_M),
                    _ => obstacle.push_m,
                };
                let out_m = touch.normal.dot(touch.point) + obstacle.thickness_m;
                let carried_m = touch.normal.dot(touch.moved).max(0.0);
                self.contacts.push(Contact {
                    point: v as u32,
                    normal: touch.normal,
                    offset_m: out_m.min(touch.normal.dot(point) + carried_m + push_m),
                    moved: touch.moved,
                    pushed_m: 0.0,
                    layer: obstacle.layer,
                    triangle: touch.triangle,
                    barycentric: touch.barycentric,
                });
            }
        }
    }

    /// Before the body, which has the last word: a foot presses a hem onto the floor, not through itself.
    fn find_floor(&mut self) {
        let lowest_m = self.floor_m + ON_FLOOR_M;
        for (v, point) in self.points.iter().enumerate() {
            if point.y > lowest_m + MARGIN_M {
                continue;
            }
            self.contacts.push(Contact {
                point: v as u32,
                normal: Vec3::Y,
                offset_m: lowest_m,
                moved: Vec3::ZERO,
                pushed_m: 0.0,
                layer: None,
                triangle: NONE,
                barycentric: Vec3::ZERO,
            });
        }
    }

    /// Brings edges that are still far too long or too short to the limit (Provot, *Deformation constraints in a
    /// mass-spring model*, 1995): the rounds above share a pull out over few edges only. Contacts have the last word,
    /// but in shirts with sleeves lengths have it: around a bent elbow, where surfaces run into each other, contacts
    /// pull a sleeve's neighbours apart.
    fn limit_strain(&mut self) {
        let contacts_last = self.rings.is_empty();
        for _ in 0..STRAIN_ROUNDS {
            if contacts_last {
                self.limit_lengths();
            }
            for contact in &mut self.contacts {
                contact.push(&mut self.points);
            }
            if !contacts_last {
                self.limit_lengths();
            }
        }
    }

    fn limit_lengths(&mut self) {
        for stretch in &self.stretches {
            stretch.limit(&mut self.points);
        }
    }

    /// Draws what is held towards where the trunk carries it.
    fn hold(&mut self, per_square: f32) {
        for (held, &at) in self.held.iter().zip(&self.anchors) {
            let point = &mut self.points[held.point as usize];
            *point += (at - *point) / (1.0 + held.compliance * per_square);
        }
    }

    /// Friction: what slides along a surface is held back in proportion to how hard it was pushed.
    fn rub(&mut self) {
        for contact in &self.contacts {
            if contact.pushed_m <= 0.0 {
                continue;
            }
            let v = contact.point as usize;
            let slip = self.points[v] - self.before[v] - contact.moved;
            let along = slip - contact.normal * contact.normal.dot(slip);
            let most_m = self.friction * contact.pushed_m;
            let share = (most_m / along.length().max(1e-9)).min(1.0);
            self.points[v] -= along * share;
        }
    }

    /// The relative change of each edge's length.
    pub(super) fn strains(&self) -> impl Iterator<Item = f32> + '_ {
        self.stretches.iter().map(|stretch| {
            let [a, b] = stretch.ends.map(|v| self.points[v as usize]);
            a.distance(b) / stretch.rest_m - 1.0
        })
    }
}

impl Stretch {
    #[inline]
    fn solve(&mut self, points: &mut [Vec3], per_square: f32) {
        let [a, b] = self.ends.map(|v| v as usize);
        let apart = points[a] - points[b];
        let length_m = apart.length();
        if length_m < 1e-7 {
            return;
        }
        let compliance = self.compliance * per_square;
        let error_m = length_m - self.rest_m;
        let delta = -(error_m + compliance * self.lambda) / (2.0 + compliance);
        self.lambda += delta;
        let push = apart * (delta / length_m);
        points[a] += push;
        points[b] -= push;
    }

    /// Brings the edge back to its limit if it is beyond.
    #[inline]
    fn limit(&self, points: &mut [Vec3]) {
        let [a, b] = self.ends.map(|v| v as usize);
        let apart = points[a] - points[b];
        let length_m = apart.length();
        let most_m = self.rest_m * STRAIN_LIMIT;
        let excess_m = (length_m - self.rest_m).abs() - most_m;
        if excess_m > 0.0 && length_m > 1e-7 {
            let push = apart * (0.5 * excess_m.copysign(self.rest_m - length_m) / length_m);
            points[a] += push;
            points[b] -= push;
        }
    }
}

impl Bend {
    fn new(points: [u32; 4], [a, b, c, d]: [Vec3; 4], compliance: f32) -> Self {
        let cotangent = |at: Vec3, left: Vec3, right: Vec3| {
            let (u, v) = (left - at, right - at);
            (u.dot(v) / u.cross(v).length().max(1e-9)).clamp(0.1, 3.0)
        };
        // At a towards c and d, at b towards c and d.
        let (ac, ad) = (cotangent(a, b, c), cotangent(a, b, d));
        let (bc, bd) = (cotangent(b, a, c), cotangent(b, a, d));
        let shares = [bc + bd, ac + ad, -(ac + bc), -(ad + bd)];
        let size = shares.map(|s| s * s).iter().sum::<f32>().sqrt() * 0.5;
        let shares = shares.map(|s| s / size);
        let rest: Vec3 = a * shares[0] + b * shares[1] + c * shares[2] + d * shares[3];
        let first = (b - a).cross(c - a).normalize_or_zero();
        let second = (d - a).cross(b - a).normalize_or_zero();
        let creased = first.dot(second) < CREASE_COSINE;
        Self {
            points,
            shares,
            rest_m: if creased { rest.length() } else { 0.0 },
            compliance: if creased {
                compliance / CREASE_STIFFNESS
            } else {
                compliance
            },
            lambda: 0.0,
        }
    }

    #[inline]
    fn solve(&mut self, points: &mut [Vec3], per_square: f32) {
        let at = self.points.map(|v| v as usize);
        let sum = points[at[0]] * self.shares[0]
            + points[at[1]] * self.shares[1]
            + points[at[2]] * self.shares[2]
            + points[at[3]] * self.shares[3];
        let length_m = sum.length();
        if length_m < 1e-7 {
            return;
        }
        let compliance = self.compliance * per_square;
        // The shares are scaled so that their squares sum to four.
        let delta = -(length_m - self.rest_m + compliance * self.lambda) / (4.0 + compliance);
        self.lambda += delta;
        let push = sum * (delta / length_m);
        for (v, share) in at.into_iter().zip(self.shares) {
            points[v] += push * share;
        }
    }
}

impl Contact {
    #[inline]
    fn push(&mut self, points: &mut [Vec3]) {
        let point = &mut points[self.point as usize];
        // What an earlier round pushed too far may come back, but nothing is ever pulled in.
        let push_m = (self.offset_m - self.normal.dot(*point)).max(-self.pushed_m);
        *point += self.normal * push_m;
        self.pushed_m += push_m;
    }
}
