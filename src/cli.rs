//! What can be typed.

use std::path::{Path, PathBuf};

use clap::{Args, Parser, Subcommand, ValueEnum};
use effigy_registration::motion::Routine;
use effigy_sim_sensor::{MotionChoice, OutfitKind, SensorPreset, dataset::DatasetPreset};
use serde::de::{DeserializeOwned, IntoDeserializer as _, value};

use crate::{
    commands::{
        bench::Part,
        evaluate::{HEADLINE_SEEDS, Method, Table},
    },
    pipeline::settings::MOST_KEYFRAMES,
};

/// One depth camera in, a live avatar out.
#[derive(Debug, Parser)]
#[command(
    name = "effigy",
    version,
    about = "Turns one depth camera into a live, animatable avatar of the person in front of it",
    after_help = "Without a command, the demo runs: a simulated person becomes an avatar.\n\n\
                  Example: effigy demo --headless --out out"
)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Option<Command>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// A simulated person in front of a simulated sensor becomes an avatar
    #[command(after_help = "Example: effigy demo --headless --out out")]
    Demo(Box<DemoArgs>),
    /// Record a simulated sensor, with the truth beside it
    #[command(
        after_help = "Example: effigy simulate --out s.mcap --sensor d435 --motion walk-in-place --seed 7"
    )]
    Simulate(SimulateArgs),
    /// Run the whole chain on a recording or a folder of images
    #[command(
        after_help = "Example: effigy replay s.mcap --headless --out out --poses out/poses.json"
    )]
    Replay(ReplayArgs),
    /// Turn other people's recordings into ours
    #[command(after_help = "Example: effigy import tum rgbd_dataset_freiburg1_xyz --out s.mcap")]
    Import(ImportArgs),
    /// Say what a recording, a folder, an avatar, a body, a network or a data set holds
    #[command(after_help = "Example: effigy info s.mcap")]
    Info(InfoArgs),
    /// Print every setting that `--config` takes, with its default
    #[command(after_help = "Example: effigy settings > mine.toml")]
    Settings(SettingsArgs),
    /// Play a motion on an avatar and write it for Blender, three.js and others
    #[command(after_help = "Example: effigy export avatar.effigy --motion walk.bvh --glb out.glb")]
    Export(ExportArgs),
    /// Simulate people in clothes, to learn from and to measure with
    #[command(after_help = "Example: effigy dataset make --preset small --out data/small")]
    Dataset(DatasetArgs),
    /// Make a prior like the one that ships with the program, or skinning networks
    #[command(
        after_help = "Example: effigy train sdf --data data/prior-actions --offset-people 4 --out sdf.safetensors"
    )]
    Train(TrainArgs),
    /// Measure how good a part of the program is, on a fixed suite
    #[command(
        after_help = "Example: effigy evaluate tracking --quick --json tracking.json\n         effigy evaluate --data data/cape-like --md table.md"
    )]
    Evaluate(EvaluateArgs),
    /// Measure how fast this machine runs it
    #[command(after_help = "Example: effigy bench --json bench.json")]
    Bench(BenchArgs),
}

impl Default for Command {
    fn default() -> Self {
        Self::Demo(Box::new(DemoArgs::parse_from(["effigy"])))
    }
}

#[derive(Debug, Parser)]
pub(crate) struct DemoArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    #[command(flatten)]
    pub(crate) chain: ChainArgs,
}

#[derive(Debug, Args)]
pub(crate) struct SceneArgs {
    /// The simulated sensor: azure, d435, oak, kinect, d455
    #[arg(long, default_value = "azure", value_parser = named::<SensorPreset>)]
    pub(crate) sensor: SensorPreset,
    /// What the person does: mixture, turn-around, walk-in-place, raise-arms, squat, wave, stand, twist, punch, shoulder-mill, hips,
    /// soccer-kick, ballerina-spin, walk, reach, sit-down, bend, chicken-wings, flying-eagle, freestyle, or a file: .bvh, .amc,
    /// SMPL's .npz or .csv
    #[arg(long, default_value = "mixture", value_parser = motion)]
    pub(crate) motion: MotionChoice,
    /// What the person wears: demo, close-fitting, loose, sport, random, bare; or simulated cloth: tshirt-trousers,
    /// tshirt-shorts, longsleeve-trousers, longsleeve-wide-trousers, polo-trousers, hoodie-trousers, cardigan-trousers,
    /// blazer-trousers, skirt, dress
    #[arg(long, default_value = "demo", value_parser = named::<OutfitKind>)]
    pub(crate) outfit: OutfitKind,
    /// A skinned glTF character (.glb, .gltf) instead of our own people, in its own clothes
    #[arg(long, value_name = "FILE", conflicts_with = "outfit")]
    pub(crate) character: Option<PathBuf>,
    /// One of the character's own movements, by name, instead of `--motion`
    #[arg(long, value_name = "NAME", requires = "character")]
    pub(crate) clip: Option<String>,
    /// Who the person is, and what the sensor gets wrong
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// How long it goes on: 20 s, and in a window until it is closed
    #[arg(long)]
    pub(crate) seconds: Option<f32>,
}

/// A name as in files; dashes and underscores are the same.
fn named<T: DeserializeOwned>(text: &str) -> Result<T, value::Error> {
    let as_typed = T::deserialize(text.into_deserializer());
    as_typed.or_else(|_: value::Error| T::deserialize(text.replace('-', "_").into_deserializer()))
}

/// Endings of motion files.
const MOTION_FILES: [&str; 4] = ["bvh", "amc", "npz", "csv"];

fn keyframe_count(text: &str) -> Result<usize, String> {
    let count: usize = text.parse().map_err(|error| format!("{error}"))?;
    if (1..=MOST_KEYFRAMES).contains(&count) {
        Ok(count)
    } else {
        Err(format!("expected 1 to {MOST_KEYFRAMES}"))
    }
}

fn motion(text: &str) -> Result<MotionChoice, value::Error> {
    let ending = text
        .rsplit_once('.')
        .map(|(_, ending)| ending.to_ascii_lowercase());
    if ending.is_some_and(|ending| MOTION_FILES.contains(&ending.as_str())) {
        return Ok(MotionChoice::File(PathBuf::from(text)));
    }
    named::<Routine>(text).map(MotionChoice::Routine)
}

#[derive(Debug, Args)]
pub(crate) struct SimulateArgs {
    /// The recording to write
    #[arg(long)]
    pub(crate) out: PathBuf,
    /// A scenario as JSON (`{"version": 1, "outfit": "dress", "fit": 0.8}`) instead of all options below; what it does
    /// not name is as usual, 20 s long
    #[arg(long, value_name = "FILE", conflicts_with_all = ["sensor", "motion", "outfit", "character", "clip", "seed", "seconds"])]
    pub(crate) scenario: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
}

#[derive(Debug, Args)]
pub(crate) struct ReplayArgs {
    /// A recording (.mcap), a TUM-style folder, a point cloud (.pcd) or one depth image (.png)
    pub(crate) input: PathBuf,
    #[command(flatten)]
    pub(crate) chain: ChainArgs,
    /// Deliver frames when the sensor did, and drop what comes too late
    #[arg(long)]
    pub(crate) realtime: bool,
}

/// What the demo and a replay share.
#[derive(Debug, Args)]
pub(crate) struct ChainArgs {
    /// No window: write pictures, the avatar and a report
    #[arg(long)]
    pub(crate) headless: bool,
    /// Where pictures, avatar and report go
    #[arg(long, default_value = "out")]
    pub(crate) out: PathBuf,
    /// How many keyframes the avatar is made of (8, or what the settings say)
    #[arg(long, value_parser = keyframe_count)]
    pub(crate) keyframes: Option<usize>,
    /// Write each frame's body in depth-camera space as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) poses: Option<PathBuf>,
    /// Write each frame's posed avatar in depth-camera space as PLY
    #[arg(long, value_name = "DIR")]
    pub(crate) meshes: Option<PathBuf>,
    /// Record the frames that were looked at and what was decided about the avatar: a replay repeats this run
    #[arg(long, value_name = "FILE")]
    pub(crate) record: Option<PathBuf>,
    /// Write the report here as well
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Save a picture of the window
    #[arg(long, value_name = "FILE")]
    pub(crate) screenshot: Option<PathBuf>,
    /// When that is, in seconds
    #[arg(long, value_name = "SECS", default_value_t = 20.0)]
    pub(crate) screenshot_after: f32,
    /// Close the window by itself
    #[arg(long, value_name = "SECS")]
    pub(crate) exit_after: Option<f32>,
    /// A body model in SMPL's layout (.npz) instead of the built-in one
    #[arg(long, value_name = "FILE")]
    pub(crate) body: Option<PathBuf>,
    /// Settings of the stages (TOML); what it does not name keeps its default
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// Of several people follow the one at this place in the picture, from 0,0 at its top left to 1,1, instead of the
    /// nearest; a replay of a run recorded with this needs it again
    #[arg(long, value_name = "X,Y", value_parser = place_in_picture)]
    pub(crate) pick: Option<[f32; 2]>,
}

/// As `--pick` has it.
fn place_in_picture(text: &str) -> Result<[f32; 2], String> {
    let share = |text: &str| {
        let number = text.trim().parse::<f32>().ok();
        number.filter(|share| (0.0..=1.0).contains(share))
    };
    let place = text
        .split_once(',')
        .and_then(|(x, y)| Some([share(x)?, share(y)?]));
    place.ok_or_else(|| "expected two numbers from 0 to 1, as in 0.3,0.5".to_owned())
}

impl ChainArgs {
    /// Everything as it is when nothing is typed, without a window.
    pub(crate) fn headless(out: &Path) -> Self {
        Self {
            headless: true,
            out: out.to_path_buf(),
            keyframes: None,
            poses: None,
            meshes: None,
            record: None,
            json: None,
            screenshot: None,
            screenshot_after: 0.0,
            exit_after: None,
            body: None,
            config: None,
            pick: None,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct ImportArgs {
    /// What the input is
    pub(crate) kind: ImportKind,
    /// The folder or file to read
    pub(crate) input: PathBuf,
    /// The recording to write
    #[arg(long)]
    pub(crate) out: PathBuf,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum ImportKind {
    /// A TUM RGB-D style folder
    Tum,
}

#[derive(Debug, Args)]
pub(crate) struct InfoArgs {
    /// A recording, a folder or single file of depth images, an avatar, a body model, a network or a data set
    pub(crate) input: PathBuf,
    /// Write what is printed as JSON too
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct SettingsArgs {
    /// With the changes of this file, which is checked
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct ExportArgs {
    /// The avatar file
    pub(crate) avatar: PathBuf,
    /// A motion file to play: .bvh, .amc, SMPL's .npz or .csv
    #[arg(long)]
    pub(crate) motion: Option<PathBuf>,
    /// The binary glTF file to write
    #[arg(long)]
    pub(crate) glb: PathBuf,
    /// At most so many morph targets carry what clothes do over the motion; 0: clothes stay as they are
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u8).range(0..=64))]
    pub(crate) modes: u8,
    /// The body model the avatar was made with, if it was not the built-in one
    #[arg(long, value_name = "FILE")]
    pub(crate) body: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct BenchArgs {
    /// Only these parts
    #[arg(long, value_delimiter = ',')]
    pub(crate) only: Vec<Part>,
    /// Write all figures here
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Few rounds and no paper-size networks: whether it runs, not how fast
    #[arg(long)]
    pub(crate) quick: bool,
    /// Keep what the fusion part worked on, for other programs to be timed on
    #[arg(long, value_name = "DIR")]
    pub(crate) keep: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct DatasetArgs {
    #[command(subcommand)]
    pub(crate) what: DatasetWhat,
}

#[derive(Debug, Subcommand)]
pub(crate) enum DatasetWhat {
    /// Make a data set; a second run goes on where the first was interrupted
    #[command(after_help = "Example: effigy dataset make --preset prior --seed 1 --out data/prior")]
    Make(DatasetMakeArgs),
    /// Make a data set of real CAPE, for those who have its licence; a second run goes on
    #[command(
        after_help = "Example: effigy dataset import-cape cape_release --body smpl_female.npz --gender female --out data/cape-female"
    )]
    ImportCape(ImportCapeArgs),
    /// Draw a contact sheet of a data set
    #[command(after_help = "Example: effigy dataset view data/prior --out prior.png")]
    View(DatasetViewArgs),
}

#[derive(Debug, Args)]
pub(crate) struct DatasetMakeArgs {
    /// What for: prior-actions and prior (to train on), cape-like (the paper's tables), dev (choosing settings), small (tests)
    #[arg(long, value_parser = kebab::<DatasetPreset>)]
    pub(crate) preset: DatasetPreset,
    /// Who the people are
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Only sequences whose name contains one of these; the others can be made later, into the same folder
    #[arg(long, value_delimiter = ',', value_name = "TEXT")]
    pub(crate) only: Vec<String>,
    /// The folder to fill
    #[arg(long)]
    pub(crate) out: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct ImportCapeArgs {
    /// The unpacked release: the folder with `sequences` and `minimal_body_shape`
    pub(crate) release: PathBuf,
    /// SMPL's body of the people that are taken (.npz)
    #[arg(long)]
    pub(crate) body: PathBuf,
    /// Only people of one gender, for whom the body was made
    #[arg(long)]
    pub(crate) gender: Option<CapeGender>,
    /// One frame in so many
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) every: u32,
    /// The folder to fill
    #[arg(long)]
    pub(crate) out: PathBuf,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub(crate) enum CapeGender {
    Female,
    Male,
}

#[derive(Debug, Args)]
pub(crate) struct DatasetViewArgs {
    /// The folder that `dataset make` or `dataset import-cape` filled
    pub(crate) dataset: PathBuf,
    /// The body model its people were made on, if it was not the built-in one
    #[arg(long)]
    pub(crate) body: Option<PathBuf>,
    /// The picture to write
    #[arg(long)]
    pub(crate) out: PathBuf,
    /// Sequences shown of each outfit
    #[arg(long, default_value_t = 1)]
    pub(crate) rows: usize,
    /// Show only sequences with this in their name, for instance `skirt` or `test-002`
    #[arg(long, default_value = "", hide_default_value = true)]
    pub(crate) only: String,
}

/// A name as the data set's files spell it.
fn kebab<T: DeserializeOwned>(text: &str) -> Result<T, value::Error> {
    T::deserialize(text.into_deserializer())
}

#[derive(Debug, Args)]
pub(crate) struct TrainArgs {
    #[command(subcommand)]
    pub(crate) what: TrainWhat,
}

#[derive(Debug, Subcommand)]
pub(crate) enum TrainWhat {
    /// Meta-learn the field of a clothed person (the seed paper's algorithm B.1)
    #[command(
        after_help = "Example: effigy train sdf --data data/prior-actions --offset-people 4 --out sdf.safetensors"
    )]
    Sdf(TrainShared),
    /// Meta-learn the hypernetwork that makes it follow the pose (algorithm B.2)
    #[command(
        after_help = "Example: effigy train hyper --data data/prior-actions --offset-people 4 --start sdf.safetensors --out prior.safetensors"
    )]
    Hyper(TrainHyperArgs),
    /// Train the skinning networks on a data set's training people
    #[command(
        after_help = "Example: effigy train skinning --data data/prior-actions --out skinning.safetensors"
    )]
    Skinning(TrainSkinningArgs),
}

#[derive(Debug, Args)]
pub(crate) struct TrainSkinningArgs {
    /// The data set (`effigy dataset make --preset prior`)
    #[arg(long, value_name = "DIR")]
    pub(crate) data: PathBuf,
    /// The file to write; a checkpoint beside it lets the run resume
    #[arg(long)]
    pub(crate) out: PathBuf,
    /// The networks' size; `paper` is only counted
    #[arg(long, value_enum, default_value = "live")]
    pub(crate) preset: TrainPreset,
    /// Which clouds, and how the networks start; 1, or what the settings say, where none is given
    #[arg(long)]
    pub(crate) seed: Option<u64>,
    /// Instead of the preset's number of steps
    #[arg(long)]
    pub(crate) steps: Option<u32>,
    /// Settings of the training (TOML); what it does not name keeps the preset's
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// Go on from the checkpoint beside the output
    #[arg(long)]
    pub(crate) resume: bool,
}

#[derive(Debug, Args)]
pub(crate) struct TrainHyperArgs {
    /// The field to start from (`effigy train sdf`)
    #[arg(long, value_name = "FILE")]
    pub(crate) start: PathBuf,
    #[command(flatten)]
    pub(crate) shared: TrainShared,
}

#[derive(Debug, Args)]
pub(crate) struct TrainShared {
    /// The file to write; checkpoint, curves and pictures lie beside it
    #[arg(long)]
    pub(crate) out: PathBuf,
    /// The data set whose training people are learned from (`effigy dataset make --preset prior-actions`); people in
    /// simpler clothes if there is none
    #[arg(long, value_name = "DIR")]
    pub(crate) data: Option<PathBuf>,
    /// Beside a data set: one person of so many is in simpler clothes; 0 for none
    #[arg(long, default_value_t = 0)]
    pub(crate) offset_people: u64,
    /// The networks' size; `paper` would take weeks
    #[arg(long, value_enum, default_value = "live")]
    pub(crate) preset: TrainPreset,
    /// Which people, poses and points; 1, or what the settings say, where none is given
    #[arg(long)]
    pub(crate) seed: Option<u64>,
    /// Go on from the checkpoint beside the output
    #[arg(long)]
    pub(crate) resume: bool,
    /// Settings of the training (TOML); what it does not name keeps its default
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
}

impl TrainShared {
    pub(crate) fn checkpoint(&self) -> PathBuf {
        self.out.with_extension("checkpoint")
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum TrainPreset {
    /// What ships
    Live,
    /// `MetaAvatar`'s
    Paper,
}

#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct EvaluateArgs {
    #[command(subcommand)]
    pub(crate) what: Option<EvaluateWhat>,
    #[command(flatten)]
    pub(crate) avatar: EvaluateAvatarArgs,
}

/// Avatars of a data set's test people, by a paper's protocol.
#[expect(
    clippy::struct_excessive_bools,
    reason = "flags that do not exclude each other"
)]
#[derive(Debug, Args)]
pub(crate) struct EvaluateAvatarArgs {
    /// The data set (`effigy dataset make --preset cape-like`)
    #[arg(long, value_name = "DIR")]
    pub(crate) data: Option<PathBuf>,
    /// How avatars are judged
    #[arg(long, value_enum, default_value = "metavatar")]
    pub(crate) protocol: Protocol,
    /// Write all figures here
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Write the table here
    #[arg(long, value_name = "FILE")]
    pub(crate) md: Option<PathBuf>,
    /// Frames of each task for each person in each outfit
    #[arg(long, default_value_t = 20)]
    pub(crate) test_frames: usize,
    /// Only these parts: few-shot, data, sensors, fitted, ablation, strangers
    #[arg(long, value_name = "TABLE", value_delimiter = ',', value_parser = kebab::<Table>)]
    tables: Vec<Table>,
    /// Only these methods, named as the tables name them
    #[arg(long, value_name = "METHOD", value_delimiter = ',', value_parser = kebab::<Method>)]
    pub(crate) methods: Vec<Method>,
    /// Seeds of our rows in the few-shot table
    #[arg(long, default_value_t = HEADLINE_SEEDS, value_parser = clap::value_parser!(u64).range(1..=HEADLINE_SEEDS))]
    pub(crate) seeds: u64,
    /// Every test person in every outfit, not only the four of the tables
    #[arg(long)]
    pub(crate) all: bool,
    /// Only these people in these outfits, named as the tables name them
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    subjects: Vec<String>,
    /// Keep the rows that the JSON file has, and go on
    #[arg(long, requires = "json")]
    pub(crate) resume: bool,
    /// One person, two frames a task
    #[arg(long)]
    pub(crate) quick: bool,
    /// Settings of the stages (TOML); what it does not name keeps its default
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
}

impl EvaluateAvatarArgs {
    pub(crate) fn tables(&self) -> &[Table] {
        if self.tables.is_empty() {
            &Table::ALL
        } else {
            &self.tables
        }
    }

    pub(crate) fn wants(&self, subject: &str) -> bool {
        self.subjects.is_empty() || self.subjects.iter().any(|name| name == subject)
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Protocol {
    /// Eight single views of a test person, then other frames (the seed paper's section 4)
    Metavatar,
}

#[derive(Debug, Subcommand)]
pub(crate) enum EvaluateWhat {
    /// How well bodies are found and followed: simulated people that nothing was tuned on
    #[command(after_help = "Example: effigy evaluate tracking --quick --json tracking.json")]
    Tracking(EvaluateTrackingArgs),
    /// How far from their true places points of test people land in star pose
    #[command(
        after_help = "Example: effigy evaluate skinning --data data/cape-like --md skinning.md"
    )]
    Skinning(EvaluateSkinningArgs),
}

#[derive(Debug, Args)]
pub(crate) struct EvaluateSkinningArgs {
    /// The data set (`effigy dataset make --preset cape-like`)
    #[arg(long, value_name = "DIR")]
    pub(crate) data: PathBuf,
    /// The networks to measure (`effigy train skinning`) instead of the shipped ones
    #[arg(long, value_name = "FILE")]
    pub(crate) networks: Option<PathBuf>,
    /// Only outfits with this in their name
    #[arg(long, default_value = "", hide_default_value = true)]
    pub(crate) outfit: String,
    /// Write all figures here
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Write the table here
    #[arg(long, value_name = "FILE")]
    pub(crate) md: Option<PathBuf>,
    /// Frames of each sequence
    #[arg(long, default_value_t = 4)]
    pub(crate) frames: usize,
}

#[derive(Debug, Args)]
pub(crate) struct EvaluateTrackingArgs {
    /// Write all figures here
    #[arg(long, value_name = "FILE")]
    pub(crate) json: PathBuf,
    /// One person, two outfits, the beginning of each movement
    #[arg(long)]
    pub(crate) quick: bool,
    /// Also without the cloth term, without visibility, without the temporal term, by another tracker's recipe, and told
    /// each frame's true surface
    #[arg(long)]
    pub(crate) ablation: bool,
    /// Other people than the test split's: tune on these, never on those
    #[arg(long, value_name = "SEED", value_delimiter = ',')]
    pub(crate) people: Vec<u64>,
    /// Only these sensors
    #[arg(long, value_delimiter = ',', value_parser = named::<SensorPreset>)]
    pub(crate) sensor: Vec<SensorPreset>,
    /// Only these outfits
    #[arg(long, value_delimiter = ',', value_parser = named::<OutfitKind>)]
    pub(crate) outfit: Vec<OutfitKind>,
    /// Settings of the stages (TOML); what it does not name keeps its default
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
}
