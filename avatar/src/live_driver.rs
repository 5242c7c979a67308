//! What a live chain drives its avatar with: a graphics card as long as one is at hand and well, the processor otherwise.

use std::sync::Arc;

use effigy_capture::FrameId;
use effigy_registration::BodyParams;

#[cfg(feature = "gpu")]
use crate::gpu::{Gpu, GpuDriver};
use crate::{
    drive::{AvatarMesh, Driver},
    model::Avatar,
};

/// Poses one avatar, and does not stop because a device does.
pub struct LiveDriver {
    cpu: Driver,
    #[cfg(feature = "gpu")]
    gpu: Option<GpuDriver>,
    gave_up: Option<String>,
}

impl LiveDriver {
    pub fn on_cpu(cpu: Driver) -> Self {
        Self {
            cpu,
            #[cfg(feature = "gpu")]
            gpu: None,
            gave_up: None,
        }
    }

    /// On the device in the full field; where that cannot do it, as `cpu` does.
    #[cfg(feature = "gpu")]
    pub fn on_gpu(cpu: Driver, gpu: &Arc<Gpu>) -> Self {
        let made = GpuDriver::new(gpu, &cpu);
        let mut driver = Self::on_cpu(cpu);
        match made {
            Ok(made) => driver.gpu = Some(made),
            Err(reason) => driver.give_up(&reason),
        }
        driver
    }

    pub fn avatar(&self) -> &Arc<Avatar> {
        self.cpu.avatar()
    }

    /// As [`Driver::pose`]. When the device fails it is given up for good, and the processor does this pose too.
    pub fn pose(&mut self, params: &BodyParams, frame: FrameId) -> AvatarMesh {
        #[cfg(feature = "gpu")]
        if let Some(gpu) = &mut self.gpu {
            match gpu.pose(params, frame) {
                Ok(mesh) => return mesh,
                Err(reason) => self.give_up(&reason),
            }
        }
        self.cpu.pose(params, frame)
    }

    /// How far the device's vertices are from the processor's in a pose, both in the full field, metres: 95 of 100 are
    /// nearer, and all have a place (else it is infinite). `None` if no device drives, or it fails and is given up.
    #[cfg(feature = "gpu")]
    pub fn off_the_processor_m(&mut self, params: &BodyParams) -> Option<f32> {
        let of_device = match self.gpu.as_mut()?.pose(params, FrameId(0)) {
            Ok(mesh) => mesh,
            Err(reason) => {
                self.give_up(&reason);
                return None;
            }
        };
        let of_processor = self.cpu.pose_in_full_field(params, FrameId(0));
        let pairs = of_device.vertices.iter().zip(&of_processor.vertices);
        let mut off_m: Vec<f32> = pairs.map(|(a, b)| a.distance(*b)).collect();
        off_m.sort_by(f32::total_cmp);
        let all_have_a_place = off_m.iter().all(|off_m| off_m.is_finite());
        let p95_m = off_m.get(off_m.len() * 95 / 100).copied().unwrap_or(0.0);
        Some(if all_have_a_place {
            p95_m
        } else {
            f32::INFINITY
        })
    }

    /// What drives, and how: "AMD Radeon RX 7600, full field".
    pub fn device(&self) -> String {
        #[cfg(feature = "gpu")]
        if let Some(gpu) = &self.gpu {
            return format!("{}, full field", gpu.gpu().name());
        }
        let how = if self.cpu.has_map() {
            "map"
        } else {
            "full field"
        };
        format!("CPU, {how}")
    }

    /// Why the graphics card that was at hand does not drive.
    pub fn gave_up(&self) -> Option<&str> {
        self.gave_up.as_deref()
    }

    /// Leaves the graphics card alone from now on.
    #[cfg(feature = "gpu")]
    pub fn give_up(&mut self, reason: &dyn std::fmt::Display) {
        let reason = reason.to_string();
        tracing::warn!(
            reason,
            "the avatar is driven without the graphics card from here on"
        );
        self.gpu = None;
        self.gave_up = Some(reason);
    }
}
