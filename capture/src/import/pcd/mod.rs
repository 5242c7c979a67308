//! Organised point clouds of PCL as single frames: the grid gives the image, z the depth.

mod layout;
mod line;
mod lzf;
mod values;

use std::{path::Path, sync::Arc};

use self::{layout::Layout, line::Line, values::Value};
use super::{intrinsics, read_file, still::Still};
use crate::{
    camera::Intrinsics,
    error::CaptureError,
    frame::Frame,
    image::{ColorImage, DepthImage},
    time::{FrameId, Timestamp},
};

/// Opens an organised cloud (ascii, binary or `binary_compressed`) in PCL's camera space: x right, y down, z forward,
/// metres. Depth becomes millimetres; the pinhole is fitted to the grid, which knows it exactly.
pub fn open(path: &Path) -> Result<Still, CaptureError> {
    let bytes = read_file(path, "the point cloud")?;
    let cloud = Cloud::parse(&bytes)
        .map_err(|reason| CaptureError::BadPointCloud { path: path.to_owned(), reason })?;
    let camera = cloud.fit_camera().unwrap_or_else(|| {
        let camera = intrinsics::default_camera([cloud.width, cloud.height]);
        tracing::warn!(
            "{}: the grid fits no pinhole camera; assuming f = {} px, centre {} {}",
            path.display(),
            camera.fx,
            camera.cx,
            camera.cy
        );
        camera
    });
    let mut calibration = intrinsics::kinect_like(camera, 1000.0);
    let color = cloud.color();
    if color.is_some() {
        calibration.color = Some(calibration.depth);
    }
    let depth = Arc::new(cloud.depth());
    let frame =
        Frame { id: FrameId(0), timestamp: Timestamp(0), depth, color: color.map(Arc::new) };
    Ok(Still::new(
        format!("point cloud {}", path.display()),
        calibration,
        frame,
    ))
}

struct Cloud {
    width: u32,
    height: u32,
    /// Row by row; NaN where nothing was measured.
    points: Vec<[f32; 3]>,
    colors: Option<Vec<[u8; 3]>>,
}

impl Cloud {
    fn parse(bytes: &[u8]) -> Result<Self, String> {
        let (layout, data) = Layout::parse(bytes)?;
        let columns = layout.columns(data)?;
        let column = |name: &str| Some(columns.of(layout.field(name)?, layout.points));
        let [Some(x), Some(y), Some(z)] = ["x", "y", "z"].map(column) else {
            return Err("expected fields x, y and z".to_owned());
        };
        let points = x
            .zip(y)
            .zip(z)
            .map(|((x, y), z)| [x, y, z].map(Value::as_f32));
        let colors = column("rgb").or_else(|| column("rgba"));
        let rgb = |value: Value| [16, 8, 0].map(|shift| (value.as_bits() >> shift) as u8);
        Ok(Self {
            width: layout.width,
            height: layout.height,
            points: points.collect(),
            colors: colors.map(|values| values.map(rgb).collect()),
        })
    }

    fn depth(&self) -> DepthImage {
        // The cast saturates: beyond 65.535 m, and for NaN, there is no measurement.
        let millimetres = |[_, _, z]: &[f32; 3]| (z * 1000.0).round();
        let in_range = |depth: f32| if depth < 65536.0 { depth as u16 } else { 0 };
        let depth = self.points.iter().map(millimetres).map(in_range).collect();
        DepthImage::new(self.width, self.height, depth).expect("one point a pixel")
    }

    fn color(&self) -> Option<ColorImage> {
        let colors = self.colors.clone()?;
        Some(ColorImage::new(self.width, self.height, colors).expect("one point a pixel"))
    }

    /// The pinhole that puts each point on its own pixel: a line through (x / z, column), and one for the rows.
    fn fit_camera(&self) -> Option<Intrinsics> {
        let (width, height) = (self.width, self.height);
        let mut columns = Line::default();
        let mut rows = Line::default();
        for (index, [x, y, z]) in (0u32..).zip(&self.points) {
            if [x, y, z].iter().all(|value| value.is_finite()) && *z > 0.0 {
                columns.add(f64::from(x / z), f64::from(index % width));
                rows.add(f64::from(y / z), f64::from(index / width));
            }
        }
        let (fx, cx) = columns.fit()?;
        let (fy, cy) = rows.fit()?;
        Some(Intrinsics { width, height, fx, fy, cx, cy })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FrameSource as _;

    const HEADER: &str = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 20\nHEIGHT 12\n\
        VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 240\n";

    /// A wall that recedes to the right, seen by a pinhole, with one hole.
    fn points() -> Vec<([f32; 3], u32)> {
        let point = |index: u32| {
            let (column, row) = ((index % 20) as f32, (index / 20) as f32);
            let z = if index == 7 {
                f32::NAN
            } else {
                1.5 + 0.05 * column
            };
            (
                [(column - 9.3) / 22.0 * z, (row - 5.6) / 21.0 * z, z],
                0x0010_2000 + index,
            )
        };
        (0..240).map(point).collect()
    }

    fn assert_is_the_wall(bytes: &[u8]) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("wall.pcd");
        std::fs::write(&path, bytes).unwrap();
        let mut still = open(&path).unwrap();
        let camera = still.calibration().depth.intrinsics;
        // f32 points know their pixel to 1e-6 of the image.
        for (got, expected) in [
            (camera.fx, 22.0),
            (camera.fy, 21.0),
            (camera.cx, 9.3),
            (camera.cy, 5.6),
        ] {
            approx::assert_abs_diff_eq!(got, expected, epsilon = 1e-3);
        }
        let frame = still.next_frame().unwrap().unwrap();
        assert_eq!(frame.depth.pixels()[7], 0);
        assert_eq!(frame.depth.pixels()[239], 2450);
        assert_eq!(frame.color.unwrap().pixels()[3], [0x10, 0x20, 3]);
        assert!(still.next_frame().unwrap().is_none());
    }

    #[test]
    fn ascii_binary_and_compressed_clouds_give_the_same_depth_and_camera() {
        let lines: Vec<String> = points()
            .iter()
            .map(|([x, y, z], rgb)| format!("{x} {y} {z} {rgb}"))
            .collect();
        let ascii = lines.join(
            "
",
        );
        assert_is_the_wall(format!("{HEADER}DATA ascii\n{ascii}").as_bytes());
        let words =
            |([x, y, z], rgb): ([f32; 3], u32)| [x.to_bits(), y.to_bits(), z.to_bits(), rgb];
        let rows: Vec<[u32; 4]> = points().into_iter().map(words).collect();
        let interleaved: Vec<u8> = rows
            .as_flattened()
            .iter()
            .flat_map(|word| word.to_le_bytes())
            .collect();
        assert_is_the_wall(&[format!("{HEADER}DATA binary\n").as_bytes(), &interleaved].concat());
        let separate: Vec<u8> = (0..4)
            .flat_map(|field| rows.iter().flat_map(move |row| row[field].to_le_bytes()))
            .collect();
        // LZF of literals only: 32 bytes at most after each control byte.
        let packed: Vec<u8> = separate
            .chunks(32)
            .flat_map(|literal| {
                std::iter::once(literal.len() as u8 - 1).chain(literal.iter().copied())
            })
            .collect();
        let sizes = [packed.len() as u32, separate.len() as u32]
            .map(u32::to_le_bytes)
            .concat();
        assert_is_the_wall(
            &[
                format!("{HEADER}DATA binary_compressed\n").as_bytes(),
                &sizes,
                &packed,
            ]
            .concat(),
        );
    }

    #[test]
    fn unorganised_short_and_nonsense_clouds_are_refused_with_the_reason() {
        let refused = |text: &str| Cloud::parse(text.as_bytes()).err().unwrap();
        assert!(refused(&HEADER.replace("HEIGHT 12", "HEIGHT 1")).contains("DATA"));
        assert!(
            refused(&format!(
                "{}DATA ascii\n",
                HEADER.replace("HEIGHT 12", "HEIGHT 1")
            ))
            .contains("organised")
        );
        assert!(refused(&format!("{HEADER}DATA ascii\n1 2 3 4")).contains("ends at point 1"));
        assert!(refused(&format!("{HEADER}DATA binary\n1234")).contains("expected 3840 bytes"));
        assert!(refused(&format!("{HEADER}DATA binary_compressed\n1234")).contains("ends before"));
        assert!(
            refused(&format!(
                "{}DATA ascii\n",
                HEADER.replace("WIDTH 20", "WIDTH 4000000000")
            ))
            .contains("more than")
        );
    }
}
