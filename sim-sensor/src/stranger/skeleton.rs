//! The nodes of a glTF file, and the clips that move them.

use glam::{Affine3A, Mat4, Quat, Vec3, Vec4};
use gltf_json::{
    animation::{Interpolation, Property},
    validation::Checked,
};

use super::document::Document;
use crate::error::SimError;

/// More nodes than any character has; a file that claims more is refused before anything is built.
const MAX_NODES: usize = 8192;

/// Nodes as a tree.
#[derive(Clone, Debug)]
pub(super) struct Skeleton {
    pub(super) names: Vec<String>,
    pub(super) parents: Vec<Option<usize>>,
    pub(super) rest: Vec<Placement>,
    /// Node numbers, parents before their children.
    order: Vec<usize>,
}

/// Where a node is relative to its parent.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    translation: Vec3,
    rotation: Quat,
    scale: Vec3,
}

/// A movement of some nodes.
#[derive(Clone, Debug)]
pub(super) struct Clip {
    pub(super) name: String,
    pub(super) secs: f32,
    tracks: Vec<Track>,
}

#[derive(Clone, Debug)]
struct Track {
    node: usize,
    property: Property,
    interpolation: Interpolation,
    times: Vec<f32>,
    /// One a time; for cubic splines three: tangent in, value, tangent out.
    values: Vec<Vec4>,
}

impl Skeleton {
    pub(super) fn of(document: &Document) -> Result<Self, SimError> {
        let nodes = &document.root.nodes;
        if nodes.len() > MAX_NODES {
            let expected = format!("at most {MAX_NODES} nodes");
            return Err(document.wrong(&expected, &nodes.len().to_string()));
        }
        let mut parents = vec![None; nodes.len()];
        for (number, node) in nodes.iter().enumerate() {
            for child in node.children.iter().flatten() {
                match parents.get_mut(child.value()) {
                    Some(parent @ None) => *parent = Some(number),
                    _ => {
                        return Err(document
                            .wrong("nodes in a tree", "a node with two parents or none such"));
                    }
                }
            }
        }
        let mut order: Vec<usize> = (0..nodes.len()).filter(|&n| parents[n].is_none()).collect();
        let mut done = 0;
        while done < order.len() {
            let children = nodes[order[done]].children.iter().flatten();
            order.extend(children.map(gltf_json::Index::value));
            done += 1;
        }
        if order.len() != nodes.len() {
            return Err(document.wrong("nodes in a tree", "a circle"));
        }
        let name = |number: usize| {
            nodes[number]
                .name
                .clone()
                .unwrap_or_else(|| format!("node {number}"))
        };
        Ok(Self {
            names: (0..nodes.len()).map(name).collect(),
            parents,
            rest: nodes.iter().map(Placement::of).collect(),
            order,
        })
    }

    /// From each node's space to the file's world.
    pub(super) fn globals(&self, placements: &[Placement]) -> Vec<Affine3A> {
        let mut globals = vec![Affine3A::IDENTITY; placements.len()];
        for &node in &self.order {
            let local = placements[node].affine();
            globals[node] = self.parents[node].map_or(local, |parent| globals[parent] * local);
        }
        globals
    }

    /// Where the nodes are at a time of a clip.
    pub(super) fn at(&self, clip: &Clip, secs: f32) -> Vec<Placement> {
        let mut placements = self.rest.clone();
        for track in &clip.tracks {
            let value = track.at(secs);
            let placement = &mut placements[track.node];
            match track.property {
                Property::Translation => placement.translation = value.truncate(),
                Property::Rotation => {
                    let rotation = Quat::from_vec4(value);
                    if rotation.length_squared() > 1e-6 {
                        placement.rotation = rotation.normalize();
                    }
                }
                Property::Scale => placement.scale = value.truncate(),
                Property::MorphTargetWeights => {}
            }
        }
        placements
    }
}

impl Placement {
    fn of(node: &gltf_json::Node) -> Self {
        if let Some(matrix) = node.matrix {
            let matrix = Mat4::from_cols_array(&matrix);
            let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
            return Self { translation, rotation, scale };
        }
        let rotation = node
            .rotation
            .map_or(Quat::IDENTITY, |q| Quat::from_array(q.0));
        Self {
            translation: node.translation.map_or(Vec3::ZERO, Vec3::from),
            rotation: if rotation.length_squared() > 1e-6 {
                rotation.normalize()
            } else {
                Quat::IDENTITY
            },
            scale: node.scale.map_or(Vec3::ONE, Vec3::from),
        }
    }

    fn affine(&self) -> Affine3A {
        Affine3A::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

impl Clip {
    /// All clips of a file.
    pub(super) fn all(document: &Document) -> Result<Vec<Self>, SimError> {
        let clips = document.root.animations.iter().enumerate();
        clips
            .map(|(number, clip)| Self::read(document, number, clip))
            .collect()
    }

    fn read(
        document: &Document,
        number: usize,
        clip: &gltf_json::Animation,
    ) -> Result<Self, SimError> {
        let name = clip
            .name
            .clone()
            .unwrap_or_else(|| format!("clip {number}"));
        let mut tracks = Vec::new();
        for channel in &clip.channels {
            let node = channel.target.node.value();
            let sampler = clip.samplers.get(channel.sampler.value());
            let (Some(sampler), Checked::Valid(property), true) = (
                sampler,
                channel.target.path,
                node < document.root.nodes.len(),
            ) else {
                return Err(document.wrong(&format!("whole channels in {name}"), "a broken one"));
            };
            let Checked::Valid(interpolation) = sampler.interpolation else {
                return Err(document.wrong("LINEAR, STEP or CUBICSPLINE", "another interpolation"));
            };
            let output = sampler.output.value();
            let values: Vec<Vec4> = match property {
                Property::MorphTargetWeights => continue,
                Property::Rotation => document
                    .numbers::<4>(output)?
                    .into_iter()
                    .map(Vec4::from)
                    .collect(),
                Property::Translation | Property::Scale => {
                    let values = document.numbers::<3>(output)?;
                    values
                        .into_iter()
                        .map(|v| Vec3::from(v).extend(0.0))
                        .collect()
                }
            };
            let times: Vec<f32> = document
                .numbers::<1>(sampler.input.value())?
                .into_iter()
                .map(|[t]| t)
                .collect();
            let each = if interpolation == Interpolation::CubicSpline {
                3
            } else {
                1
            };
            if times.is_empty() || !times.is_sorted() || values.len() != each * times.len() {
                let found = format!("{} times and {} values", times.len(), values.len());
                return Err(
                    document.wrong(&format!("a value for each rising time in {name}"), &found)
                );
            }
            tracks.push(Track { node, property, interpolation, times, values });
        }
        let ends = tracks
            .iter()
            .filter_map(|track| track.times.last().copied());
        let secs = ends.fold(0.0, f32::max);
        Ok(Self { name, secs, tracks })
    }
}

impl Track {
    fn at(&self, secs: f32) -> Vec4 {
        let after = self.times.partition_point(|&time| time <= secs);
        let last = self.times.len() - 1;
        let before = after.saturating_sub(1);
        let after = after.min(last);
        let cubic = self.interpolation == Interpolation::CubicSpline;
        let value = |key: usize| {
            if cubic {
                self.values[3 * key + 1]
            } else {
                self.values[key]
            }
        };
        let between_secs = self.times[after] - self.times[before];
        if between_secs <= 0.0 || self.interpolation == Interpolation::Step {
            return value(before);
        }
        let share = ((secs - self.times[before]) / between_secs).clamp(0.0, 1.0);
        if cubic {
            let (leaving, arriving) = (self.values[3 * before + 2], self.values[3 * after]);
            return hermite(
                value(before),
                leaving * between_secs,
                value(after),
                arriving * between_secs,
                share,
            );
        }
        if self.property == Property::Rotation {
            let (from, to) = (
                Quat::from_vec4(value(before)),
                Quat::from_vec4(value(after)),
            );
            return Vec4::from(from.slerp(to, share));
        }
        value(before).lerp(value(after), share)
    }
}

fn hermite(from: Vec4, leaving: Vec4, to: Vec4, arriving: Vec4, t: f32) -> Vec4 {
    let (t2, t3) = (t * t, t * t * t);
    from * (2.0 * t3 - 3.0 * t2 + 1.0)
        + leaving * (t3 - 2.0 * t2 + t)
        + to * (3.0 * t2 - 2.0 * t3)
        + arriving * (t3 - t2)
}
