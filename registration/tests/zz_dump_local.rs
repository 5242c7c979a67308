//! Local.
use effigy_registration::smpl::builtin;
#[test]
fn dump() {
    use std::io::Write as _;
    let body = builtin::body();
    let mut f = std::fs::File::create("/work/tmpbody/dump.json").unwrap();
    let v: Vec<[f32; 3]> = body.template.iter().map(|v| v.to_array()).collect();
    let s: Vec<Vec<[f32; 3]>> = body
        .shape_dirs
        .iter()
        .map(|d| d.iter().map(|v| v.to_array()).collect())
        .collect();
    let w: Vec<([u8; 4], [f32; 4])> = body.skinning.iter().map(|w| (w.bones, w.weights)).collect();
    let j: Vec<[f32; 3]> = body
        .joints(&body.template)
        .iter()
        .map(|v| v.to_array())
        .collect();
    let r: Vec<(&Vec<u32>, &Vec<f32>)> = body
        .joint_regressor
        .iter()
        .map(|r| (&r.indices, &r.weights))
        .collect();
    let p: Vec<(&Vec<u32>, Vec<[f32; 3]>)> = body
        .pose_dirs
        .iter()
        .map(|r| {
            (
                &r.vertices,
                r.offsets.iter().map(|v| v.to_array()).collect(),
            )
        })
        .collect();
    write!(f, "{}", serde_json::json!({"v": v, "s": s, "w": w, "j": j, "t": body.triangles, "r": r, "p": p, "id": body.identity.to_string()})).unwrap();
}
