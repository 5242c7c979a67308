//! Wearing: garments on a moving body, frame by frame.

use std::sync::Arc;

use effigy_registration::{
    motion::MotionPose,
    smpl::{BoneTransforms, JOINT_COUNT},
};
use glam::{Quat, Vec3};

use super::{
    collider::{Arm, Collider, Obstacle, Part, REACH_M},
    form::{Form, cut_pose},
    let_out::{let_out, trials},
    pattern::ClothKind,
    sew::{Garment, sew},
    sheet::Sheet,
    sleeve::{ARM_JOINTS, ArmAxes},
    solver::Cloth,
};
use crate::{
    person::{Person, smoothstep},
    random::Randomness,
};

/// How cloth is simulated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClothConfig {
    /// Longest time of one step.
    pub step_secs: f32,
    /// The body may move this far in one step; faster movement gets more steps.
    pub step_m: f32,
    /// Rounds over all constraints in one step; more than two garments get two more for each.
    pub iterations: usize,
    /// Cloth stays this far from skin, and from other cloth.
    pub skin_m: f32,
    pub layer_m: f32,
    /// Before the first frame: time to take its pose, and time to settle in it.
    pub approach_secs: f32,
    pub settle_secs: f32,
}

impl Default for ClothConfig {
    fn default() -> Self {
        Self {
            step_secs: 1.0 / 360.0,
            step_m: 0.006,
            iterations: 4,
            skin_m: 0.003,
            layer_m: 0.003,
            approach_secs: 0.8,
            settle_secs: 1.0,
        }
    }
}

/// The body is posed anew this often; between, its points move straight.
const POSE_SECS: f32 = 1.0 / 60.0;
const WARM_UP_RATE_HZ: f32 = 30.0;
/// A body that jumps further than this between two poses takes its clothes along as if they were skin.
const JUMP_M: f32 = 0.35;
const MAX_STEPS: usize = 48;
/// Garments give way to those over them: by this share of each push, and no further than that in one step.
const REACTION: f32 = 0.3;
const MAX_REACTION_M: f32 = 0.0005;
/// How far hips and knees are bent while trousers are cut.
const SEAT_RAD: f32 = 0.6;
/// Further rounds for each garment beyond two: what is pressed by others takes longer to find its length again.
const LAYER_ITERATIONS: usize = 2;
/// Cloth is never perfectly even; the seed decides where it buckles.
const UNEVEN_M: f32 = 0.0005;

/// Clothes on one person, and where they are now.
#[derive(Clone, Debug)]
pub struct Wear {
    /// The person under the clothes.
    person: Arc<Person>,
    config: ClothConfig,
    /// From the innermost to the outermost.
    garments: Arc<Vec<Garment>>,
    cut: MotionPose,
    /// The cut garments, not perfectly even.
    laid_out: Arc<Vec<Vec<Vec3>>>,
    cloths: Vec<Cloth>,
    body: Collider,
    /// Each arm once more, for its sleeve.
    arms: [Part; 2],
    /// Each garment as an obstacle for those over it.
    layers: Vec<Collider>,
    pose: MotionPose,
}

/// Everything the next frame follows from.
#[derive(Clone, Debug, PartialEq)]
pub struct ClothState {
    pub pose: MotionPose,
    points: Vec<Vec<Vec3>>,
    velocities: Vec<Vec<Vec3>>,
}

impl Wear {
    /// Cuts an outfit to a person who wears nothing else but shoes. `fit` goes from tight (0) to loose (1).
    pub fn new(
        person: Arc<Person>,
        kind: ClothKind,
        fit: f32,
        seed: u64,
        config: ClothConfig,
    ) -> Self {
        let cut = cut_pose(kind.legs_apart_rad(), 0.0);
        let form = Form::new(&person, &cut);
        let seat = Form::new(&person, &cut_pose(kind.legs_apart_rad(), SEAT_RAD));
        let trials = trials(&person);
        let (mut garments, mut cloths) = (Vec::<Garment>::new(), Vec::<Cloth>::new());
        for pattern in kind.patterns(fit, seed) {
            let cut_on = if pattern.has_legs() { &seat } else { &form };
            let garment = sew(cut_on, &pattern, &garments, &form);
            cloths.push(Cloth::new(&garment, &let_out(&garment, cut_on, &trials)));
            garments.push(garment);
        }
        let random = Randomness::new(seed, 0, 0xc10f);
        for (cloth, garment) in cloths.iter_mut().zip(&garments) {
            cloth.points.clone_from(&garment.laid_out);
        }
        let mut at = 0;
        for point in cloths.iter_mut().flat_map(|cloth| &mut cloth.points) {
            let uneven = Vec3::from_array([0, 1, 2].map(|k| random.uniform(at + k) - 0.5));
            *point += uneven * UNEVEN_M;
            at += 3;
        }
        let laid_out = cloths.iter().map(|cloth| cloth.points.clone()).collect();
        let on = |g: &Garment| Collider::new(&g.rest.moved_to(&g.laid_out));
        let layers = garments.iter().map(on).collect();
        let body = Collider::new(&form.surface);
        let arms = Arm::BOTH.map(|arm| Part::arm(arm, &form.surface, &form.skinning));
        Self {
            person,
            config,
            garments: Arc::new(garments),
            cut,
            laid_out: Arc::new(laid_out),
            cloths,
            body,
            arms,
            layers,
            pose: cut,
        }
    }

    pub fn garments(&self) -> &[Garment] {
        &self.garments
    }

    pub fn person(&self) -> &Arc<Person> {
        &self.person
    }

    pub fn pose(&self) -> &MotionPose {
        &self.pose
    }

    /// Where each garment's points are.
    pub fn points(&self) -> impl Iterator<Item = &[Vec3]> {
        self.cloths.iter().map(|cloth| cloth.points.as_slice())
    }

    /// Garments as they lie now, as obstacles.
    pub(super) fn layers(&self) -> &[Collider] {
        &self.layers
    }

    pub fn speeds_m_s(&self) -> impl Iterator<Item = f32> + '_ {
        let velocities = self.cloths.iter().flat_map(|cloth| &cloth.velocities);
        velocities.map(|velocity| velocity.length())
    }

    /// Relative changes of edge lengths.
    pub fn strains(&self) -> impl Iterator<Item = f32> + '_ {
        self.cloths.iter().flat_map(Cloth::strains)
    }

    /// The body with shoes and hair where the clothes feel it.
    pub fn body_points(&self) -> &[Vec3] {
        &self.body.now
    }

    /// From the pose in which clothes were cut to a first pose, and some time to settle there.
    pub fn start(&mut self, first: &MotionPose) {
        let turn = Quat::from_scaled_axis(first.theta[0]);
        let pelvis = self.person.rest_joints[0];
        for (cloth, laid_out) in self.cloths.iter_mut().zip(self.laid_out.iter()) {
            for (v, &point) in laid_out.iter().enumerate() {
                cloth.points[v] = turn * (point - pelvis) + pelvis + first.trans;
                cloth.velocities[v] = Vec3::ZERO;
            }
        }
        let mut cut = self.cut;
        cut.theta[0] = first.theta[0];
        cut.trans = first.trans;
        self.place_body(&cut);
        let frames = (self.config.approach_secs * WARM_UP_RATE_HZ)
            .round()
            .max(1.0);
        for frame in 1..=frames as usize {
            let share = frame as f32 / frames;
            self.step(
                &cut.interpolate(first, smoothstep(0.0, 1.0, share)),
                WARM_UP_RATE_HZ.recip(),
            );
        }
        for _ in 0..(self.config.settle_secs * WARM_UP_RATE_HZ).round() as usize {
            self.step(first, WARM_UP_RATE_HZ.recip());
        }
    }

    /// Moves on to a pose that is reached after some time.
    pub fn step(&mut self, pose: &MotionPose, secs: f32) {
        let parts = (secs / POSE_SECS - 1e-3).ceil().clamp(1.0, 240.0) as usize;
        let from = self.pose;
        for cloth in &mut self.cloths {
            cloth.forget_searches(self.arms.len() + self.garments.len() + 1);
        }
        for part in 1..=parts {
            let next = if part == parts {
                *pose
            } else {
                from.interpolate(pose, part as f32 / parts as f32)
            };
            self.step_to(&next, secs / parts as f32);
        }
        self.pose = *pose;
        self.finish();
    }

    pub fn state(&self) -> ClothState {
        let each = |of: fn(&Cloth) -> &Vec<Vec3>| {
            self.cloths.iter().map(|cloth| of(cloth).clone()).collect()
        };
        ClothState {
            pose: self.pose,
            points: each(|cloth| &cloth.points),
            velocities: each(|cloth| &cloth.velocities),
        }
    }

    /// Goes back to a state; what follows is the same to the last bit.
    pub fn restore(&mut self, state: &ClothState) {
        for (i, cloth) in self.cloths.iter_mut().enumerate() {
            cloth.points.copy_from_slice(&state.points[i]);
            cloth.velocities.copy_from_slice(&state.velocities[i]);
        }
        self.place_body(&state.pose);
    }

    fn place_body(&mut self, pose: &MotionPose) {
        self.pose = *pose;
        let points = self.person.clothed_posed_vertices(&pose.theta, pose.trans);
        self.body.place(&points);
        for arm in &mut self.arms {
            arm.place(&points);
        }
        let anchors = self.anchors(pose);
        let arm_axes = self.arm_axes(pose);
        let floor_m = self.floor_m();
        for (cloth, anchors) in self.cloths.iter_mut().zip(anchors) {
            cloth.anchors = anchors;
            cloth.arm_axes = arm_axes;
            cloth.floor_m = floor_m;
        }
        for (layer, cloth) in self.layers.iter_mut().zip(&self.cloths) {
            layer.place(&cloth.points);
        }
    }

    fn step_to(&mut self, pose: &MotionPose, secs: f32) {
        let from = self.body.now.clone();
        let to = self.person.clothed_posed_vertices(&pose.theta, pose.trans);
        let anchors_from: Vec<_> = self
            .cloths
            .iter()
            .map(|cloth| cloth.anchors.clone())
            .collect();
        let anchors_to = self.anchors(pose);
        let (axes_from, axes_to) = (self.arm_axes(&self.pose), self.arm_axes(pose));
        let far_m = from
            .iter()
            .zip(&to)
            .map(|(a, b)| a.distance(*b))
            .fold(0.0, f32::max);
        if far_m > JUMP_M {
            self.carry(pose);
            return;
        }
        let by_time = (secs / self.config.step_secs - 1e-3).ceil();
        let by_way = (far_m / self.config.step_m).ceil();
        let steps = (by_time.max(by_way) as usize).clamp(1, MAX_STEPS);
        for step in 1..=steps {
            let share = step as f32 / steps as f32;
            let between = from.iter().zip(&to).map(|(a, b)| a.lerp(*b, share));
            self.body.advance(between);
            for arm in &mut self.arms {
                arm.advance(&self.body.now);
            }
            let floor_m = self.floor_m();
            for (number, cloth) in self.cloths.iter_mut().enumerate() {
                cloth.floor_m = floor_m;
                for (i, anchor) in cloth.anchors.iter_mut().enumerate() {
                    *anchor = anchors_from[number][i].lerp(anchors_to[number][i], share);
                }
                cloth.arm_axes = std::array::from_fn(|arm| {
                    std::array::from_fn(|k| axes_from[arm][k].lerp(axes_to[arm][k], share))
                });
            }
            self.step_cloths(secs / steps as f32);
        }
        self.pose = *pose;
    }

    /// Where people of ours stand; recorded movement that goes deeper has its floor there.
    fn floor_m(&self) -> f32 {
        let heights = self.body.now.iter().map(|point| point.y);
        heights.fold(0.0, f32::min)
    }

    /// Where a pose has shoulders, elbows, wrists and hands.
    pub(super) fn arm_axes(&self, pose: &MotionPose) -> ArmAxes {
        let (_, joints) = BoneTransforms::from_pose(&pose.theta, &self.person.rest_joints);
        ARM_JOINTS.map(|arm| arm.map(|joint| joints[joint] + pose.trans))
    }

    /// Where a pose carries what is held, for each garment.
    fn anchors(&self, pose: &MotionPose) -> Vec<Vec<Vec3>> {
        let bones = bones_of(&self.person, &pose.theta);
        let each = |cloth: &Cloth| {
            let held = cloth.held.iter();
            held.map(|held| bones.blend(&held.weights).transform_point3(held.at_rest) + pose.trans)
                .collect()
        };
        self.cloths.iter().map(each).collect()
    }

    fn step_cloths(&mut self, secs: f32) {
        let count = self.cloths.len();
        let iterations = self.config.iterations + LAYER_ITERATIONS * count.saturating_sub(2);
        for number in 0..count {
            let mut obstacles = skin(&self.arms, &self.body, self.config.skin_m);
            for (below, layer) in self.layers[..number].iter().enumerate() {
                obstacles.push(Obstacle::layer(below, layer, self.config.layer_m));
            }
            self.cloths[number].step(secs, iterations, &obstacles);
            let (inner, outer) = self.cloths.split_at_mut(number);
            for (below, triangle, barycentric, push) in outer[0].reactions() {
                let corners = self.layers[below].corners(triangle);
                let push = REACTION * push.clamp_length_max(MAX_REACTION_M);
                for (corner, part) in corners.into_iter().zip(barycentric.to_array()) {
                    inner[below].points[corner as usize] += push * part;
                }
            }
            if number + 1 < count {
                let points = self.cloths[number].points.iter().copied();
                self.layers[number].advance(points);
            }
        }
    }

    /// Removes what little the last step left inside of something.
    fn finish(&mut self) {
        for number in 0..self.cloths.len() {
            let mut skin = skin(&self.arms, &self.body, 0.7 * self.config.skin_m);
            for obstacle in &mut skin {
                obstacle.push_m = REACH_M;
            }
            self.cloths[number].push_out(&skin);
            let points = self.cloths[number].points.clone();
            self.layers[number].place(&points);
        }
    }

    /// Takes the clothes along as if they were skin.
    fn carry(&mut self, pose: &MotionPose) {
        let bones =
            |pose: &MotionPose| BoneTransforms::from_pose(&pose.theta, &self.person.rest_joints).0;
        let (old, new) = (bones(&self.pose), bones(pose));
        let old_trans = self.pose.trans;
        for (cloth, garment) in self.cloths.iter_mut().zip(self.garments.iter()) {
            for (v, weights) in garment.weights.iter().enumerate() {
                let at_rest = old
                    .blend(weights)
                    .inverse()
                    .transform_point3(cloth.points[v] - old_trans);
                cloth.points[v] = new.blend(weights).transform_point3(at_rest) + pose.trans;
                cloth.velocities[v] = Vec3::ZERO;
            }
        }
        self.place_body(pose);
    }
}

/// The body as obstacles: arms for their sleeves, then all of it.
fn skin<'a>(arms: &'a [Part; 2], body: &'a Collider, thickness_m: f32) -> Vec<Obstacle<'a>> {
    let [left, right] = arms;
    vec![
        Obstacle::part(left, thickness_m),
        Obstacle::part(right, thickness_m),
        Obstacle::body(body, thickness_m),
    ]
}

/// The body's bones in a pose.
pub(super) fn bones_of(person: &Person, theta: &[Vec3; JOINT_COUNT]) -> BoneTransforms {
    BoneTransforms::from_pose(theta, &person.rest_joints).0
}

impl Sheet {
    /// The same piece in another place.
    pub(super) fn moved_to(&self, points: &[Vec3]) -> Self {
        Self { points: points.to_vec(), triangles: self.triangles.clone() }
    }
}
