//! Draws individuals beside each other, from the front and turned: `people OUT.png [COUNT [OUTFIT]]`.

use std::{env, error::Error};

use effigy_capture::{Intrinsics, Rigid3};
use effigy_registration::{
    motion::Routine,
    smpl::{JOINT_COUNT, builtin},
};
use effigy_sim_sensor::{Outfit, OutfitKind, Person, Room, render::Renderer};
use glam::{Quat, Vec3, vec3};

const CAMERA: Intrinsics =
    Intrinsics { width: 150, height: 300, fx: 420.0, fy: 420.0, cx: 74.5, cy: 149.5 };
const TURNS_RAD: [f32; 2] = [0.0, 1.2];

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = env::args().skip(1);
    let out = args.next().unwrap_or_else(|| "people.png".to_owned());
    let count: u32 = args.next().map_or(Ok(8), |count| count.parse())?;
    let outfit = args.next().unwrap_or_else(|| "bare".to_owned());
    let kind: OutfitKind = serde_json::from_value(serde_json::Value::String(outfit))?;
    let (width, height) = (CAMERA.width, CAMERA.height);
    let mut sheet = image::RgbImage::new(width * count, height * TURNS_RAD.len() as u32);
    for number in 0..count {
        let seed = u64::from(number);
        let person = Person::individual(builtin::body(), Outfit::new(kind, seed), seed);
        for (row, turn_rad) in TURNS_RAD.into_iter().enumerate() {
            for (pixel, color) in portrait(&person, seed, turn_rad).into_iter().enumerate() {
                let (x, y) = (pixel as u32 % width, pixel as u32 / width);
                sheet.put_pixel(
                    number * width + x,
                    row as u32 * height + y,
                    image::Rgb(color),
                );
            }
        }
    }
    sheet.save(out)?;
    Ok(())
}

fn portrait(person: &Person, seed: u64, turn_rad: f32) -> Vec<[u8; 3]> {
    let motion = Routine::Stand.motion(&person.rest_body(), 30.0, seed);
    let mut theta: [Vec3; JOINT_COUNT] = motion.poses[0].theta;
    let turned = Quat::from_rotation_y(turn_rad) * Quat::from_scaled_axis(theta[0]);
    theta[0] = turned.to_scaled_axis();
    let mesh = person.clothed_posed(&theta, motion.poses[0].trans);
    let world_from_camera = Rigid3 {
        rotation: Quat::from_rotation_x(std::f32::consts::PI),
        translation: vec3(0.0, 0.92, 3.2),
    };
    let mut renderer = Renderer::new(CAMERA, world_from_camera, Room::Empty);
    renderer
        .render(&mesh, &person.paint, &person.body.skinning)
        .shaded()
}
