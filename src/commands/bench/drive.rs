//! The avatar in pose after pose, and its mesh extracted in full.

use std::sync::{
    Arc,
    atomic::{AtomicUsize, Ordering},
};

use anyhow::Context as _;
use effigy_avatar::{
    Avatar, DriveConfig, Driver, MapConfig, ShapeMap, SignedDistanceField, Subject, TopologyConfig,
    hyper, mesher,
    skinning::{ClosestBodyPoint, ClosestBodyPointConfig},
};
use effigy_capture::FrameId;
use effigy_fusion::mesh::marching_cubes::marching_cubes;
use effigy_registration::{
    BodyParams,
    motion::{RestBody, Routine},
    smpl::builtin,
};
use glam::Vec3;

use super::{Row, gpu, in_turn::in_turn};
use crate::pipeline::avatar_job::map_motions;

/// MetaAvatar's grid, and one that a dense evaluation can afford here.
const RESOLUTION: usize = 256;
const DENSE_RESOLUTION: usize = 128;

/// Where a graphics card has more to do than a pose's overhead.
const FINE_VERTICES: usize = 25_000;

pub(super) fn rows(quick: bool) -> anyhow::Result<Vec<Row>> {
    let body = builtin::body();
    let subject = Subject::new(&body, &[0.0; 10])?;
    let rest = RestBody::of(&body, &subject.betas);
    let network = Arc::new(hyper::prior());
    let skinning = ClosestBodyPoint::new(body, &subject.betas, ClosestBodyPointConfig::default());
    let theta = Routine::Stand.motion(&rest, 30.0, 1).poses[0].theta;
    let avatar = |topology: TopologyConfig| {
        let field = Arc::clone(&network);
        let avatar = Avatar::new(&subject, field, &skinning, &theta, &topology)?;
        anyhow::Ok(Arc::new(avatar))
    };
    let own = avatar(TopologyConfig::default())?;
    let mut rows = poses(&own, &rest, if quick { 30 } else { 600 })?;
    let fine = || {
        let topology = TopologyConfig { vertices: FINE_VERTICES, ..TopologyConfig::default() };
        avatar(topology)
    };
    rows.extend(gpu::rows(&own, fine, &params_of(&rest), quick)?);
    let sdf = network.field(&subject.pose_input(&theta));
    rows.extend(meshes(&sdf, if quick { 64 } else { RESOLUTION }, quick));
    Ok(rows)
}

/// The live drive on its own, each pose another one: with the map that an avatar gets, and with its full field.
fn poses(avatar: &Arc<Avatar>, rest: &RestBody, count: usize) -> anyhow::Result<Vec<Row>> {
    let new = || Driver::new(Arc::clone(avatar), DriveConfig::default());
    let mut full = new();
    let map = ShapeMap::learn(
        &mut full,
        &map_motions(rest),
        &MapConfig::default(),
        &mut || true,
    )?
    .context("the prior has coefficients")?;
    let error = map.error;
    let mut mapped = new().with_map(map);
    let params = params_of(rest);
    let (mut a, mut b) = (0, 0);
    let [by_field, by_map] = in_turn(
        count,
        [
            &mut || {
                full.pose(&params(a), FrameId(0));
                a += 1;
            },
            &mut || {
                mapped.pose(&params(b), FrameId(0));
                b += 1;
            },
        ],
    );
    let vertices = avatar.topology.vertices_in_unit.len();
    Ok(vec![
        Row::new("drive, full field", by_field.recip(), "poses/s"),
        Row::new("drive, live", by_map.recip(), "poses/s")
            .against("the full field's", by_field / by_map),
        Row::new(
            "live drive off the full field, p95 in unseen motions",
            f64::from(error.p95_mm),
            "mm",
        ),
        Row::new("vertices driven", vertices as f64, ""),
    ])
}

/// Somebody's movement, pose by pose, over and over.
fn params_of(rest: &RestBody) -> impl Fn(usize) -> BodyParams + use<> {
    let motion = Routine::Mixture.motion(rest, 30.0, 1);
    move |number: usize| {
        let pose = &motion.poses[number % motion.poses.len()];
        BodyParams { betas: [0.0; 10], theta: pose.theta, trans: pose.trans }
    }
}

/// Following the surface against asking the whole grid.
fn meshes(sdf: &dyn SignedDistanceField, resolution: usize, quick: bool) -> Vec<Row> {
    let counting = Counting { sdf, values: AtomicUsize::new(0) };
    mesher::extract(&counting, resolution);
    let values = counting.values.into_inner();
    let [secs] = in_turn(
        if quick { 1 } else { 5 },
        [&mut || {
            mesher::extract(sdf, resolution);
        }],
    );
    let compared = if quick { 32 } else { DENSE_RESOLUTION };
    let [followed, dense] = in_turn(
        if quick { 1 } else { 3 },
        [
            &mut || {
                mesher::extract(sdf, compared);
            },
            &mut || dense_mesh(sdf, compared),
        ],
    );
    vec![
        Row::new(format!("mesh, {resolution}^3"), secs, "s"),
        Row::new(
            format!("field values for it, {resolution}^3"),
            values as f64,
            "",
        ),
        Row::new(format!("mesh, {compared}^3"), followed, "s")
            .against("the dense grid", dense / followed),
    ]
}

fn dense_mesh(sdf: &dyn SignedDistanceField, resolution: usize) {
    let spacing = 2.0 / (resolution - 1) as f32;
    let layer = resolution * resolution;
    let mut values = vec![0.0; layer * resolution];
    let mut points = vec![Vec3::ZERO; layer];
    for (z, values) in values.chunks_exact_mut(layer).enumerate() {
        for (place, point) in points.iter_mut().enumerate() {
            let (x, y) = (place % resolution, place / resolution);
            *point = Vec3::new(x as f32, y as f32, z as f32) * spacing - 1.0;
        }
        sdf.values(&points, values);
    }
    marching_cubes(&values, [resolution; 3], Vec3::NEG_ONE, spacing);
}

/// A field that counts what it is asked.
struct Counting<'a> {
    sdf: &'a dyn SignedDistanceField,
    values: AtomicUsize,
}

impl SignedDistanceField for Counting<'_> {
    fn values(&self, points: &[Vec3], out: &mut [f32]) {
        self.values.fetch_add(points.len(), Ordering::Relaxed);
        self.sdf.values(points, out);
    }

    fn values_and_gradients(&self, points: &[Vec3], values: &mut [f32], gradients: &mut [Vec3]) {
        self.values.fetch_add(2 * points.len(), Ordering::Relaxed);
        self.sdf.values_and_gradients(points, values, gradients);
    }
}
