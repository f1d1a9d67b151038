//! What a reduction says of itself: nothing is dropped silently.

use super::{
    Axes, Channels, Form, PictureError, Reduction, Request, Saved, Setting, Shape, Widths, words,
};
use crate::convention::storage::{Depth, WidthStorage};
use crate::preview::Look;
use serde_json::{Value, json};

impl Reduction {
    /// What was not judged, and why, in one sentence; none where all was.
    pub fn not_judged(&self) -> Option<String> {
        let (formats, why) = self.unjudged.as_ref()?;
        let names: Vec<&str> = formats.iter().map(|f| f.name()).collect();
        Some(format!(
            "whether {} would be seen to differ was not judged: {why}",
            names.join(", ")
        ))
    }

    /// What the reduced map no longer has, a sentence each; empty for the full map.
    pub fn dropped(&self, request: &Request<'_>) -> Vec<String> {
        let full = request.map.size();
        let form = self.form();
        let mut dropped = Vec::new();
        match form.shape {
            Shape::Constant(_) => {
                return [
                    vec![format!("the map: one texel stands for all {full}")],
                    self.dropped_model(request),
                ]
                .concat();
            }
            Shape::Radial(..) if form.bytes_per_texel() == 0 => dropped.push(format!(
                "the map: one lobe, turned around the centre, stands for all {full}"
            )),
            Shape::Radial(_, samples) => dropped.push(format!(
                "what changes around the centre: {samples} samples outward stand for {full} texels"
            )),
            Shape::Grid(size) if size != full => {
                dropped.push(format!("texels: {size} stand for {full}"));
            }
            Shape::Grid(_) => {}
        }
        match form.widths {
            Widths::Each => {}
            Widths::Round => {
                dropped.push("the difference between the widths, and with it the axis".to_owned());
            }
            Widths::X => dropped.push("how alpha_y changes".to_owned()),
            Widths::Y => dropped.push("how alpha_x changes".to_owned()),
            Widths::Same => dropped.push("how the widths change".to_owned()),
        }
        if form.axes == Axes::Same && form.widths != Widths::Round {
            dropped.push(match form.shape {
                Shape::Radial(..) => {
                    "how the axis changes against the outward direction".to_owned()
                }
                _ => "how the axis changes".to_owned(),
            });
        }
        dropped.extend(self.dropped_bits());
        [dropped, self.dropped_model(request)].concat()
    }

    /// Of each channel that has fewer bits than a float, how far they reach.
    fn dropped_bits(&self) -> Option<String> {
        let form = self.form();
        let Channels { x, y, axis } = form.channels;
        let map = &self.kept.map;
        let worst = |storage: WidthStorage, plane: &[f32]| {
            let errors = plane.iter().map(|a| storage.relative_error(*a));
            100.0 * errors.fold(0.0, f32::max)
        };
        let mut kept = Vec::new();
        let mut width = |name: &str, storage: WidthStorage, percent: f32| {
            if storage.depth != Depth::F32 {
                kept.push(format!("{name} as {storage} within {percent:.2} %"));
            }
        };
        let of_x = worst(x, map.alpha_x());
        let of_y = worst(y, map.alpha_y());
        let alike = (x.depth, x.encoding) == (y.depth, y.encoding);
        match form.widths {
            Widths::Same => {}
            Widths::Round => width("the width", x, of_x),
            Widths::Each if alike => width("widths", x, of_x.max(of_y)),
            Widths::X => width("alpha_x", x, of_x),
            Widths::Y => width("alpha_y", y, of_y),
            Widths::Each => {
                width("alpha_x", x, of_x);
                width("alpha_y", y, of_y);
            }
        }
        if form.axes == Axes::Each && axis.depth != Depth::F32 {
            let degrees = axis.angle_error().to_degrees();
            kept.push(format!("the axis as {axis} within {degrees:.3} degrees"));
        }
        (!kept.is_empty()).then(|| format!("bits: {}", kept.join(", ")))
    }

    fn dropped_model(&self, request: &Request<'_>) -> Vec<String> {
        let pairs = request.looks.iter().zip(&self.looks);
        let changed = pairs.filter(|(asked, kept)| asked != kept);
        changed
            .map(|(asked, kept)| format!("the model: {kept} in place of {asked}"))
            .collect()
    }

    /// Each setting with each look, and its error.
    pub fn pictures<'a>(
        &'a self,
        request: &'a Request<'_>,
    ) -> impl Iterator<Item = (&'a Setting, Look, PictureError)> {
        let with_looks = |setting| self.looks.iter().map(move |look| (setting, *look));
        let shown = request.settings.iter().flat_map(with_looks);
        shown
            .zip(&self.errors)
            .map(|((setting, look), error)| (setting, look, *error))
    }

    /// Everything as JSON, whose keys stay as they are from version to version.
    pub fn to_json(&self, request: &Request<'_>, saved: &Saved) -> Value {
        let form = self.form();
        let full = request.map.size();
        let scenes: Vec<Value> = self
            .pictures(request)
            .map(|(setting, look, error)| {
                json!({
                    "model": look.to_string(),
                    "mesh": setting.mesh_name,
                    "light": setting.light_name,
                    "exposure": setting.scene.exposure,
                    "error": error,
                })
            })
            .collect();
        json!({
            "metric": request.metric,
            "tolerance": { "mean": plain(request.tolerance), "p999": request.tolerance_of_p999() },
            "picture": [request.size.width(), request.size.height()],
            "reference_samples": self.reference_samples,
            "k_max": plain(self.k_max),
            "scenes": scenes,
            "full": {
                "size": [full.width(), full.height()],
                "model": words(request.looks),
                "bytes": self.full_bytes,
                "milliseconds": self.full_milliseconds,
            },
            "reduced": {
                "kind": form.kind(),
                "size": size(form.shape),
                "widths": form.widths,
                "axes": form.axes,
                "storage": match form.shape {
                    Shape::Constant(_) => Value::Null,
                    _ if form.bytes_per_texel() == 0 => Value::Null,
                    _ => json!(form.stored()),
                },
                "channels": channels(form),
                "model": words(&self.looks),
                "bytes": form.bytes(),
                "bytes_per_texel": form.bytes_per_texel(),
                "file_bytes": saved.map_bytes,
                "milliseconds": self.milliseconds,
            },
            "seen_in": self.seen_in,
            "seen_in_floats": self.seen_in_floats,
            "unjudged": self.unjudged.as_ref().map(|(formats, _)| formats),
            "dropped": self.dropped(request),
            "recipe": saved.recipe,
            "files": saved.files,
            "tried": self.trials,
        })
    }
}

/// A number as it was typed: 0.01 as an f32 is 0.0099999998 as an f64.
fn plain(x: f32) -> f64 {
    x.to_string().parse().unwrap_or(f64::from(x))
}

/// How each channel is stored; null where it is one number for all.
fn channels(form: Form) -> Value {
    let Channels { x, y, axis } = form.channels;
    let is_map = !matches!(form.shape, Shape::Constant(_));
    let width = |keep: bool, storage: WidthStorage| match (is_map && keep, storage.depth.top()) {
        (false, _) => Value::Null,
        (true, None) => json!({ "depth": storage.depth, "encoding": storage.encoding }),
        (true, Some(_)) => json!({
            "depth": storage.depth,
            "encoding": storage.encoding,
            "low": plain(storage.low),
            "high": plain(storage.high),
        }),
    };
    let round = form.widths == Widths::Round;
    json!({
        "alpha_x": width(form.widths.keep_x(), x),
        "alpha_y": width(round || form.widths.keep_y(), y),
        "axis": if is_map && form.axes == Axes::Each { json!(axis) } else { Value::Null },
    })
}

fn size(shape: Shape) -> Value {
    match shape {
        Shape::Constant(_) => json!([0, 0]),
        Shape::Radial(_, samples) => json!([samples, 1]),
        Shape::Grid(size) => json!([size.width(), size.height()]),
    }
}
