//! One-off: shipped checkpoints of format 2.
use std::path::Path;

use burn::tensor::{Bytes, DType, Shape};
use burn_pack::{Reader, Scalar, Tensor, Writer};

use super::{fit, hybrid, transitions};
use crate::model::LastLayer;
use crate::train::{Backend, FitSettings};

#[test]
fn print_names() {
    let segments = transitions(20, -0.5, 1);
    let model = hybrid((8.0, 2.0), &segments, Backend::NdArray, LastLayer::Zero);
    let run = fit(model, &segments, FitSettings { epochs: 3, ..FitSettings::default() });
    let bytes = run.optimizer.to_bytes();
    let reader = Reader::from_bytes(Bytes::from_bytes_vec(bytes)).unwrap();
    println!("{:?}\n{:?}", reader.scalars(), reader.metadata());
    for t in reader.into_tensors().unwrap() {
        let (name, dtype, shape, id, _) = t.into_parts().unwrap();
        println!("{name} {dtype:?} {shape:?} {id:?}");
    }
}

#[test]
fn convert() {
    for name in ["acrobot-sim", "pendulum-sim"] {
        let dir = Path::new(env!("CARGO_MANIFEST_DIR")).join("checkpoints").join(name);
        let old = std::fs::read(dir.join("optimizer.safetensors")).unwrap();
        let old = safetensors::SafeTensors::deserialize(&old).unwrap();
        let f32s = |which: &str| -> Vec<f32> {
            let data = old.tensor(which).unwrap().data();
            data.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
        };
        let path = dir.join("checkpoint.json");
        let mut json: serde_json::Value =
            serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        let steps = json["optimizer_steps"][0].as_u64().unwrap();
        assert_eq!(json["optimizer_steps"][1], 0);
        let widths: Vec<usize> = serde_json::from_value(json["prior"]["widths"].clone()).unwrap();
        let mut tensors = Vec::new();
        let (mut scalars, mut paths) = (Vec::new(), Vec::new());
        for (moment, values) in [("moment_1", f32s("prior.first")), ("moment_2", f32s("prior.second"))] {
            let mut rest = values.as_slice();
            let mut flat: Vec<f32> = Vec::new();
            for pair in widths.windows(2) {
                let (i, o) = (pair[0], pair[1]);
                let (w, after) = rest.split_at(i * o);
                let (b, after) = after.split_at(o);
                rest = after;
                flat.extend((0..i * o).map(|n| w[(n % o) * i + n / o]));
                flat.extend(b);
            }
            assert!(rest.is_empty());
            let bytes: Vec<u8> = flat.iter().flat_map(|x| x.to_le_bytes()).collect();
            tensors.push(Tensor::new(format!("1.momentum.{moment}"), DType::F32, Shape::from([flat.len()]), Some(1), Bytes::from_bytes_vec(bytes)));
        }
        scalars.push(("1.__rank".to_owned(), Scalar::from(1usize)));
        scalars.push(("1.momentum.time".to_owned(), Scalar::from(steps as usize)));
        paths.push(("1".to_owned(), "first".to_owned()));
        let mut writer = Writer::new(tensors);
        for (k, v) in scalars { writer = writer.with_scalar(&k, v); }
        for (k, v) in paths { writer = writer.with_metadata(&k, &v); }
        // In the order of names, as the program writes it.
        let reader = Reader::from_bytes(writer.into_bytes().unwrap()).unwrap();
        let (scalars, paths) = (reader.scalars().clone(), reader.metadata().clone());
        let mut writer = Writer::new(reader.into_tensors().unwrap());
        for (k, v) in scalars { writer = writer.with_scalar(&k, v); }
        for (k, v) in paths { writer = writer.with_metadata(&k, &v); }
        let bytes = writer.into_bytes().unwrap().to_vec();
        let object = json.as_object_mut().unwrap();
        object["format"] = 3.into();
        object.remove("optimizer_steps");
        object.insert("optimizer".into(), crate::files::content_id(&bytes).into());
        std::fs::write(dir.join("optimizer.bpk"), &bytes).unwrap();
        // Written as the program does, with its order of keys.
        let manifest: crate::train::Manifest = serde_json::from_value(json).unwrap();
        std::fs::write(&path, serde_json::to_vec_pretty(&manifest).unwrap()).unwrap();
        std::fs::remove_file(dir.join("optimizer.safetensors")).unwrap();
    }
}
