//! What is compared: the avatar, and what it has to beat.

use std::{ops::ControlFlow, sync::Arc};

use anyhow::Context as _;
use effigy_avatar::{
    Avatar, CanonicalSamples, Canonicaliser, PoseField, PoseInput, SignedDistanceField,
    TopologyConfig, extract_posed,
    fine_tune::{FineTuneConfig, fine_tune},
    hyper::{HyperNetwork, PRIOR_CONFIG},
};
use effigy_fusion::{TriangleMesh, mesh::sample::sample_surface};
use effigy_registration::{BodyModel, BodyParams};

use super::subject::Subject;
use crate::{
    interrupt,
    pipeline::{clock::Clock, evaluate::RESOLUTION, settings::Settings},
};

/// Points of a true surface that the oracle learns from.
const ORACLE_POINTS: usize = 5000;

/// The oracle may take its time.
const ORACLE_STEPS_FACTOR: u32 = 3;

#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Method {
    /// The minimal body.
    BareBody,
    /// One surface for all poses: the same network, always given the same pose.
    Static,
    /// From random parameters instead of the prior, with as many steps.
    NoMetaLearning,
    Effigy,
    /// The same network, fitted to the whole true surface of the very frames it is judged on.
    Oracle,
}

impl Method {
    pub(super) const ALL: [Self; 5] = [
        Self::BareBody,
        Self::Static,
        Self::NoMetaLearning,
        Self::Effigy,
        Self::Oracle,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::BareBody => "bare_body",
            Self::Static => "static",
            Self::NoMetaLearning => "no_meta_learning",
            Self::Effigy => "effigy",
            Self::Oracle => "oracle",
        }
    }
}

/// A method that has learned what it can of one person.
pub(super) enum Fitted {
    BareBody(Arc<BodyModel>),
    Avatar(Box<(Avatar, Canonicaliser)>),
}

impl Fitted {
    /// The surface in a pose.
    pub(super) fn posed(&self, params: &BodyParams) -> TriangleMesh {
        match self {
            Self::BareBody(body) => {
                let mut mesh =
                    TriangleMesh::new(body.pose(params).vertices, body.triangles.clone());
                mesh.compute_normals();
                mesh
            }
            Self::Avatar(learned) => {
                let (avatar, canonicaliser) = &**learned;
                extract_posed(avatar, &**canonicaliser.skinning(), params, RESOLUTION)
            }
        }
    }
}

pub(super) fn fit(
    method: Method,
    subject: &Subject,
    body: &Arc<BodyModel>,
    settings: &Settings,
    clock: Clock,
) -> anyhow::Result<Fitted> {
    if method == Method::BareBody {
        return Ok(Fitted::BareBody(Arc::clone(body)));
    }
    let params = subject.keyframes[0]
        .params()
        .context("true poses are known")?;
    let config = settings.canonicalise.clone();
    let canonicaliser =
        Canonicaliser::new(Arc::clone(body), &params.betas, config)?.with_camera(&subject.camera);
    let seen = || -> Vec<CanonicalSamples> {
        let frames = subject.keyframes.iter();
        frames
            .filter_map(|frame| Some(canonicaliser.process(frame)?.0))
            .collect()
    };
    let one_pose = canonicaliser.subject().pose_input(&params.theta);
    let prior = || settings.prior_network(body.identity);
    let mut tuning = settings.fine_tune;
    let (start, samples) = match method {
        Method::Oracle => {
            tuning.steps *= ORACLE_STEPS_FACTOR;
            (prior()?, whole_surfaces(subject, &canonicaliser))
        }
        Method::NoMetaLearning => (HyperNetwork::untrained(PRIOR_CONFIG, tuning.seed), seen()),
        Method::Static => {
            let in_one_pose = seen()
                .into_iter()
                .map(|samples| CanonicalSamples { pose: one_pose, ..samples });
            (prior()?, in_one_pose.collect())
        }
        Method::Effigy | Method::BareBody => (prior()?, seen()),
    };
    let network = tuned(start, &samples, &canonicaliser, &tuning, clock)?;
    let field: Arc<dyn PoseField> = if method == Method::Static {
        Arc::new(OnePose { network, pose: one_pose })
    } else {
        Arc::new(network)
    };
    let avatar = Avatar::new(
        canonicaliser.subject(),
        field,
        &**canonicaliser.skinning(),
        &params.theta,
        &TopologyConfig::default(),
    )?;
    Ok(Fitted::Avatar(Box::new((avatar, canonicaliser))))
}

fn tuned(
    start: HyperNetwork,
    samples: &[CanonicalSamples],
    canonicaliser: &Canonicaliser,
    config: &FineTuneConfig,
    clock: Clock,
) -> anyhow::Result<HyperNetwork> {
    let metres_per_unit = canonicaliser.subject().unit_box.metres_per_unit();
    let mut go_on = |_: &_| {
        if interrupt::requested() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let secs = || clock.secs();
    Ok(fine_tune(
        start,
        samples,
        metres_per_unit,
        config,
        &secs,
        &mut go_on,
    )?)
}

/// The true surfaces of the frames that are judged.
fn whole_surfaces(subject: &Subject, canonicaliser: &Canonicaliser) -> Vec<CanonicalSamples> {
    let of_person = canonicaliser.subject();
    let tests = subject.tests.iter().enumerate();
    tests
        .map(|(number, test)| {
            let samples = sample_surface(&test.truth_in_star, ORACLE_POINTS, number as u64);
            let points = samples.iter();
            CanonicalSamples {
                theta: test.params.theta,
                pose: of_person.pose_input(&test.params.theta),
                points_in_unit: points
                    .map(|sample| of_person.unit_box.unit_from_canonical(sample.point))
                    .collect(),
                normals: samples.iter().map(|sample| sample.normal).collect(),
                weights: vec![1.0; samples.len()],
                free_in_unit: Vec::new(),
            }
        })
        .collect()
}

/// A network that is always given the same pose.
struct OnePose {
    network: HyperNetwork,
    pose: PoseInput,
}

impl PoseField for OnePose {
    fn field(&self, _pose: &PoseInput) -> Box<dyn SignedDistanceField> {
        PoseField::field(&self.network, &self.pose)
    }

    fn kind(&self) -> &'static str {
        "one-pose"
    }

    fn to_bytes(&self) -> Vec<u8> {
        PoseField::to_bytes(&self.network)
    }
}
