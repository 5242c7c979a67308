//! The avatar file, `*.effigy`: everything of an [`Avatar`], versioned and checksummed.
//!
//! Little-endian: magic `EFFIGYAV`, format number (u32), length of the header (u32), the header as JSON,
//! then the arrays in the order of [`Layout`], the field's parameters, and a CRC-32 of all bytes before it.
//! The header's counts say how long a whole file is.

use std::{
    fs::{self, File},
    io::{Read as _, Write as _},
    path::Path,
    sync::Arc,
};

use effigy_registration::smpl::{BodyIdentity, JOINT_COUNT, VertexWeights};
use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{
    error::AvatarError,
    model::{Avatar, PoseField, Subject, Topology},
};

const MAGIC: [u8; 8] = *b"EFFIGYAV";
const FORMAT: u32 = 1;
/// Nothing this program writes comes near; a longer file is not read into memory.
const MAX_FILE_BYTES: u64 = 1 << 30;
const MAX_HEADER_BYTES: usize = 1 << 16;
/// Magic, format and header length.
const PREFIX_BYTES: usize = 16;
const CRC_BYTES: usize = 4;

/// What a file says about itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AvatarHeader {
    pub subject: Subject,
    /// The pose the mesh was extracted at.
    pub topology_theta: [Vec3; JOINT_COUNT],
    pub vertices: u32,
    pub triangles: u32,
    pub field_kind: String,
    pub field_bytes: u32,
}

/// Turns a field's kind and parameters back into a field.
pub type FieldDecoder<'a> = dyn Fn(&str, &[u8]) -> Result<Arc<dyn PoseField>, AvatarError> + 'a;

/// Writes an avatar; an older file of that name is replaced only by a whole new one.
pub fn write(path: &Path, avatar: &Avatar) -> Result<(), AvatarError> {
    let bytes = to_bytes(avatar)?;
    let io = |source| AvatarError::Io { path: path.to_path_buf(), source };
    let mut unfinished = path.as_os_str().to_owned();
    unfinished.push(".part");
    let mut file = File::create(&unfinished).map_err(io)?;
    file.write_all(&bytes)
        .and_then(|()| file.sync_all())
        .map_err(io)?;
    fs::rename(&unfinished, path).map_err(io)
}

/// Reads an avatar that was made with this body.
pub fn read(
    path: &Path,
    body: BodyIdentity,
    decode: &FieldDecoder<'_>,
) -> Result<Avatar, AvatarError> {
    let file = Whole::read(path)?;
    let found = file.header.subject.body;
    if found != body {
        return Err(AvatarError::OtherBody {
            path: path.to_path_buf(),
            found: found.to_string(),
            expected: body.to_string(),
        });
    }
    file.avatar(decode)
}

/// Checks a whole file and returns what it says about itself.
pub fn read_header(path: &Path) -> Result<AvatarHeader, AvatarError> {
    Ok(Whole::read(path)?.header)
}

/// Where the parts of a file lie, as byte offsets.
struct Layout {
    vertices: usize,
    normals: usize,
    triangles: usize,
    bones: usize,
    weights: usize,
    field: usize,
    crc: usize,
}

impl Layout {
    fn new(header: &AvatarHeader, header_bytes: usize) -> Self {
        // 32-bit counts times small sizes cannot overflow 64 bits.
        let (count, triangle_count) = (header.vertices as usize, header.triangles as usize);
        let vertices = PREFIX_BYTES + header_bytes;
        let normals = vertices + 12 * count;
        let triangles = normals + 12 * count;
        let bones = triangles + 12 * triangle_count;
        let weights = bones + 4 * count;
        let field = weights + 16 * count;
        let crc = field + header.field_bytes as usize;
        Self { vertices, normals, triangles, bones, weights, field, crc }
    }

    fn file_bytes(&self) -> usize {
        self.crc + CRC_BYTES
    }
}

fn to_bytes(avatar: &Avatar) -> Result<Vec<u8>, AvatarError> {
    let topology = &avatar.topology;
    let field = avatar.field.to_bytes();
    let header = AvatarHeader {
        subject: avatar.subject,
        topology_theta: avatar.topology_theta,
        vertices: topology.vertices_in_unit.len() as u32,
        triangles: topology.triangles.len() as u32,
        field_kind: avatar.field.kind().to_owned(),
        field_bytes: field.len() as u32,
    };
    let json = serde_json::to_vec(&header)
        .map_err(|error| AvatarError::Export(format!("avatar header: {error}")))?;
    let layout = Layout::new(&header, json.len());
    let mut bytes = Vec::with_capacity(layout.file_bytes());
    bytes.extend(MAGIC);
    bytes.extend(FORMAT.to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(&json);
    for vector in topology.vertices_in_unit.iter().chain(&topology.normals) {
        bytes.extend(vector.to_array().iter().flat_map(|x| x.to_le_bytes()));
    }
    bytes.extend(
        topology
            .triangles
            .iter()
            .flatten()
            .flat_map(|index| index.to_le_bytes()),
    );
    bytes.extend(topology.skinning.iter().flat_map(|weights| weights.bones));
    let weights = topology.skinning.iter().flat_map(|weights| weights.weights);
    bytes.extend(weights.flat_map(f32::to_le_bytes));
    bytes.extend(&field);
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    Ok(bytes)
}

/// A file that is complete and has the right checksum.
struct Whole<'a> {
    path: &'a Path,
    bytes: Vec<u8>,
    header: AvatarHeader,
    layout: Layout,
}

impl<'a> Whole<'a> {
    fn read(path: &'a Path) -> Result<Self, AvatarError> {
        let bytes = read_bounded(path)?;
        let header_bytes = check_prefix(path, &bytes)?;
        let broken = |offset, what| broken(path, offset, what);
        let json = bytes
            .get(PREFIX_BYTES..PREFIX_BYTES + header_bytes)
            .ok_or_else(|| broken(bytes.len(), "the file ends within its header".to_owned()))?;
        let header: AvatarHeader = serde_json::from_slice(json)
            .map_err(|error| broken(PREFIX_BYTES, format!("unreadable header: {error}")))?;
        let layout = Layout::new(&header, header_bytes);
        if bytes.len() != layout.file_bytes() {
            let (found, expected) = (bytes.len(), layout.file_bytes());
            let what = format!("the file has {found} bytes, its header announces {expected}");
            return Err(broken(found.min(expected), what));
        }
        let (content, crc) = bytes.split_at(layout.crc);
        let (found, expected) = (crc32fast::hash(content), u32_at(crc, 0));
        if found != expected {
            let what = format!("the checksum is {found:08x}, expected {expected:08x}");
            return Err(broken(layout.crc, what));
        }
        Ok(Self { path, bytes, header, layout })
    }

    fn avatar(&self, decode: &FieldDecoder<'_>) -> Result<Avatar, AvatarError> {
        self.check_subject()?;
        let (layout, count) = (&self.layout, self.header.vertices as usize);
        let triangle_count = self.header.triangles as usize;
        let topology = Topology {
            vertices_in_unit: self.vectors(layout.vertices, count)?,
            normals: self.vectors(layout.normals, count)?,
            triangles: Arc::new(self.triangles(layout.triangles, triangle_count)?),
            skinning: self.skinning(count)?,
        };
        let field = &self.bytes[layout.field..layout.crc];
        let field =
            decode(&self.header.field_kind, field).map_err(AvatarError::in_file(self.path))?;
        Ok(Avatar {
            subject: self.header.subject,
            field,
            topology_theta: self.header.topology_theta,
            topology,
        })
    }

    /// Somebody of a size that people have, with numbers that are.
    fn check_subject(&self) -> Result<(), AvatarError> {
        /// From a doll to a giant.
        const SPANS_M: std::ops::RangeInclusive<f32> = 0.1..=10.0;
        let AvatarHeader { subject, topology_theta, .. } = &self.header;
        let Subject { unit_box, rest_joints, betas, .. } = subject;
        let mut vectors = rest_joints
            .iter()
            .chain(topology_theta)
            .chain([&unit_box.center]);
        let mut numbers = betas.iter().chain([&unit_box.min_m]);
        if !SPANS_M.contains(&unit_box.span_m) {
            let what = format!("a body of {} m, expected {SPANS_M:?}", unit_box.span_m);
            return Err(self.broken(PREFIX_BYTES, what));
        }
        if !numbers.all(|number| number.is_finite()) || !vectors.all(|v| v.is_finite()) {
            let what = "a shape, joints or a pose that are no numbers".to_owned();
            return Err(self.broken(PREFIX_BYTES, what));
        }
        Ok(())
    }

    fn vectors(&self, start: usize, count: usize) -> Result<Vec<Vec3>, AvatarError> {
        (0..count)
            .map(|index| {
                let at = start + 12 * index;
                let vector = Vec3::from_array([0, 4, 8].map(|offset| self.float(at + offset)));
                let finite = vector.is_finite().then_some(vector);
                finite.ok_or_else(|| self.broken(at, format!("vector {index} is not finite")))
            })
            .collect()
    }

    fn triangles(&self, start: usize, count: usize) -> Result<Vec<[u32; 3]>, AvatarError> {
        (0..count)
            .map(|index| {
                let at = start + 12 * index;
                let triangle = [0, 4, 8].map(|offset| u32_at(&self.bytes, at + offset));
                let valid = triangle.iter().all(|&vertex| vertex < self.header.vertices);
                valid.then_some(triangle).ok_or_else(|| {
                    let vertices = self.header.vertices;
                    self.broken(
                        at,
                        format!("triangle {triangle:?}, but {vertices} vertices"),
                    )
                })
            })
            .collect()
    }

    fn skinning(&self, count: usize) -> Result<Vec<VertexWeights>, AvatarError> {
        (0..count)
            .map(|index| {
                let (bones_at, weights_at) = (
                    self.layout.bones + 4 * index,
                    self.layout.weights + 16 * index,
                );
                let bones = std::array::from_fn(|slot| self.bytes[bones_at + slot]);
                let weights = std::array::from_fn(|slot| self.float(weights_at + 4 * slot));
                let valid = bones.iter().all(|&bone| usize::from(bone) < JOINT_COUNT)
                    && weights.iter().all(|weight| (0.0..=1.001).contains(weight))
                    && (weights.iter().sum::<f32>() - 1.0).abs() < 0.01;
                valid
                    .then_some(VertexWeights { bones, weights })
                    .ok_or_else(|| {
                        self.broken(
                            bones_at,
                            format!("bones {bones:?} with weights {weights:?}"),
                        )
                    })
            })
            .collect()
    }

    fn float(&self, offset: usize) -> f32 {
        f32::from_bits(u32_at(&self.bytes, offset))
    }

    fn broken(&self, offset: usize, what: String) -> AvatarError {
        broken(self.path, offset, what)
    }
}

/// The file's bytes, if there are not too many.
fn read_bounded(path: &Path) -> Result<Vec<u8>, AvatarError> {
    let io = |source| AvatarError::Io { path: path.to_path_buf(), source };
    let file = File::open(path).map_err(io)?;
    // One byte more than allowed tells a longer file.
    let mut bytes = Vec::new();
    file.take(MAX_FILE_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(io)?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        let what = format!("longer than {MAX_FILE_BYTES} bytes, which no avatar is");
        return Err(broken(path, bytes.len(), what));
    }
    Ok(bytes)
}

/// Checks magic and format; returns the header's length.
fn check_prefix(path: &Path, bytes: &[u8]) -> Result<usize, AvatarError> {
    if !bytes.starts_with(&MAGIC) {
        let found = bytes[..bytes.len().min(MAGIC.len())].to_vec();
        return Err(AvatarError::NotAnAvatar { path: path.to_path_buf(), found });
    }
    if bytes.len() < PREFIX_BYTES {
        return Err(broken(
            path,
            bytes.len(),
            "the file ends before its header".to_owned(),
        ));
    }
    let found = u32_at(bytes, 8);
    if found != FORMAT {
        return Err(AvatarError::UnknownVersion {
            path: path.to_path_buf(),
            found,
            expected: FORMAT,
        });
    }
    let header_bytes = u32_at(bytes, 12) as usize;
    if header_bytes > MAX_HEADER_BYTES {
        let what = format!("a header of {header_bytes} bytes, at most {MAX_HEADER_BYTES} expected");
        return Err(broken(path, 12, what));
    }
    Ok(header_bytes)
}

fn u32_at(bytes: &[u8], offset: usize) -> u32 {
    u32::from_le_bytes(std::array::from_fn(|index| bytes[offset + index]))
}

fn broken(path: &Path, offset: usize, what: String) -> AvatarError {
    AvatarError::Broken { path: path.to_path_buf(), offset: offset as u64, what }
}

#[cfg(test)]
mod tests {
    use effigy_registration::smpl::UnitBox;
    use proptest::prelude::*;

    use super::*;
    use crate::{pose_input::PoseInput, sdf::SignedDistanceField, testing::Analytic};

    struct Sphere(f32);

    impl PoseField for Sphere {
        fn field(&self, _: &PoseInput) -> Box<dyn SignedDistanceField> {
            let radius = self.0;
            Box::new(Analytic(move |p: Vec3| p.length() - radius))
        }

        fn kind(&self) -> &'static str {
            "sphere"
        }

        fn to_bytes(&self) -> Vec<u8> {
            self.0.to_le_bytes().to_vec()
        }
    }

    fn decode(kind: &str, bytes: &[u8]) -> Result<Arc<dyn PoseField>, AvatarError> {
        if kind != "sphere" {
            let expected = "sphere".to_owned();
            return Err(AvatarError::UnknownField { found: kind.to_owned(), expected });
        }
        Ok(Arc::new(Sphere(f32::from_bits(u32_at(bytes, 0)))))
    }

    fn avatar() -> Avatar {
        let subject = Subject {
            body: BodyIdentity([7; 16]),
            betas: [0.1; 10],
            rest_joints: [Vec3::ONE; JOINT_COUNT],
            unit_box: UnitBox { center: Vec3::X, min_m: -0.8, span_m: 1.7 },
        };
        let topology = Topology {
            vertices_in_unit: vec![Vec3::X, Vec3::Y, Vec3::Z],
            normals: vec![Vec3::Z; 3],
            triangles: Arc::new(vec![[0, 1, 2]]),
            skinning: vec![VertexWeights { bones: [3, 0, 0, 0], weights: [1.0, 0.0, 0.0, 0.0] }; 3],
        };
        let theta = [Vec3::splat(0.1); JOINT_COUNT];
        Avatar { subject, field: Arc::new(Sphere(0.5)), topology_theta: theta, topology }
    }

    fn read_bytes(bytes: &[u8]) -> Result<Avatar, AvatarError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.effigy");
        fs::write(&path, bytes).unwrap();
        read(&path, BodyIdentity([7; 16]), &decode)
    }

    #[test]
    fn what_is_written_is_read_back_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.effigy");
        write(&path, &avatar()).unwrap();
        let back = read(&path, BodyIdentity([7; 16]), &decode).unwrap();
        assert_eq!(back.subject, avatar().subject);
        assert_eq!(back.topology, avatar().topology);
        assert_eq!(back.topology_theta, avatar().topology_theta);
        assert_eq!(back.field.to_bytes(), avatar().field.to_bytes());
        assert_eq!(read_header(&path).unwrap().vertices, 3);
        assert_eq!(
            fs::read_dir(folder.path()).unwrap().count(),
            1,
            "no unfinished file is left"
        );
    }

    #[test]
    fn an_avatar_with_the_shipped_prior_survives_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.effigy");
        let saved = Avatar { field: Arc::new(crate::hyper::prior()), ..avatar() };
        saved.save(&path).unwrap();
        let loaded = Avatar::load(&path, BodyIdentity([7; 16])).unwrap();
        let pose = saved.subject.pose_input(&saved.topology_theta);
        let points = [Vec3::ZERO, Vec3::splat(0.3), Vec3::new(-0.2, 0.7, 0.1)];
        let values = |avatar: &Avatar| {
            let mut values = [0.0; 3];
            avatar.field.field(&pose).values(&points, &mut values);
            values
        };
        assert_eq!(values(&loaded), values(&saved));
        let other = Avatar { field: Arc::new(Sphere(0.5)), ..avatar() };
        other.save(&path).unwrap();
        let error = Avatar::load(&path, BodyIdentity([7; 16])).err().unwrap();
        assert!(error.to_string().contains("a.effigy"), "{error}");
        let AvatarError::InFile { source, .. } = error else {
            panic!("{error}");
        };
        assert!(
            matches!(&*source, AvatarError::UnknownField { found, .. } if found == "sphere"),
            "{source}"
        );
    }

    #[test]
    fn foreign_files_newer_formats_and_other_bodies_are_told_apart() {
        let bytes = to_bytes(&avatar()).unwrap();
        assert!(matches!(
            read_bytes(b"glTF...."),
            Err(AvatarError::NotAnAvatar { .. })
        ));
        assert!(matches!(
            read_bytes(b""),
            Err(AvatarError::NotAnAvatar { .. })
        ));
        let mut newer = bytes.clone();
        newer[8] = 9;
        let error = read_bytes(&newer).err().unwrap();
        assert!(matches!(
            error,
            AvatarError::UnknownVersion { found: 9, expected: 1, .. }
        ));

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.effigy");
        fs::write(&path, &bytes).unwrap();
        let error = read(&path, BodyIdentity([8; 16]), &decode).err().unwrap();
        let text = error.to_string();
        assert!(
            text.contains("a.effigy") && text.contains(&"07".repeat(16)),
            "{text}"
        );
    }

    #[test]
    fn a_header_that_announces_too_much_is_refused_without_allocating_it() {
        let mut bytes = to_bytes(&avatar()).unwrap();
        let text = b"\"vertices\":3";
        let at = bytes
            .windows(text.len())
            .position(|window| window == text)
            .unwrap();
        bytes[at + text.len() - 1] = b'9';
        let error = read_bytes(&bytes).err().unwrap();
        assert!(matches!(error, AvatarError::Broken { .. }), "{error}");
        bytes[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(matches!(
            read_bytes(&bytes),
            Err(AvatarError::Broken { offset: 12, .. })
        ));
    }

    #[test]
    fn valid_checksums_do_not_excuse_wild_indices() {
        let mut wild = avatar();
        wild.topology.triangles = Arc::new(vec![[0, 1, 3]]);
        let error = read_bytes(&to_bytes(&wild).unwrap()).err().unwrap();
        assert!(
            error
                .to_string()
                .contains("triangle [0, 1, 3], but 3 vertices"),
            "{error}"
        );
        wild = avatar();
        wild.topology.skinning[1].bones[0] = 24;
        assert!(read_bytes(&to_bytes(&wild).unwrap()).is_err());
        wild = avatar();
        wild.topology.normals[2].y = f32::NAN;
        assert!(read_bytes(&to_bytes(&wild).unwrap()).is_err());
        wild = avatar();
        wild.topology.skinning[1].weights = [1.0, 1.0, 0.0, 0.0];
        assert!(read_bytes(&to_bytes(&wild).unwrap()).is_err());
        for span_m in [-1.7, 0.0, 1e30] {
            wild = avatar();
            wild.subject.unit_box.span_m = span_m;
            let error = read_bytes(&to_bytes(&wild).unwrap()).err().unwrap();
            assert!(error.to_string().contains("a body of"), "{error}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        #[test]
        fn no_flipped_bit_goes_unnoticed(position in any::<prop::sample::Index>(), bit in 0_u32..8) {
            let mut bytes = to_bytes(&avatar()).unwrap();
            let position = position.index(bytes.len());
            bytes[position] ^= 1_u8 << bit;
            prop_assert!(read_bytes(&bytes).is_err());
        }

        #[test]
        fn no_cut_goes_unnoticed(length in any::<prop::sample::Index>()) {
            let bytes = to_bytes(&avatar()).unwrap();
            prop_assert!(read_bytes(&bytes[..length.index(bytes.len())]).is_err());
        }

        #[test]
        fn no_noise_is_taken_for_an_avatar(
            noise in prop::collection::vec(any::<u8>(), 0..300),
            keep_magic in any::<bool>(),
        ) {
            let mut bytes = noise;
            if keep_magic {
                bytes.splice(0..0, MAGIC.into_iter().chain(FORMAT.to_le_bytes()));
            }
            prop_assert!(read_bytes(&bytes).is_err());
        }
    }
}
