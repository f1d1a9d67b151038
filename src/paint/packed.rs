//! Strokes as a recipe stores them.
//!
//! ```toml
//! [layers.strokes]
//! mesh = "torus"                 # only where strokes on the mesh lie on another mesh than the recipe's
//! packed = ["AAEAgIAB…", "…"]    # runs of strokes, first to last
//! [[layers.strokes.brushes]]     # each brush once
//! radius = 0.02
//! tool = "comb"
//! ```
//!
//! A packed string is base64 (standard alphabet, no padding) of whole strokes, up to [`RUN`] of them when we write it, so that
//! a stroke more changes one line of the file. Numbers are variable-length: seven bits a byte, the low ones first, the top bit
//! set where more follow. Signed numbers are folded (0, -1, 1, -2, … are 0, 1, 2, 3, …). A stroke is
//!
//! - the number of its brush in `brushes`,
//! - flags: 1 on the mesh, 2 pressure changes along it,
//! - its seed, and how many points it has,
//! - on the mesh, signed: the power of two that a step is,
//! - the pressure in 4096ths, where it does not change,
//! - for each point, as signed differences from the point before (the first from zeros): the pressure where it changes; then
//!   x and y in steps of 2^-22 UV, or x, y and z in the stroke's steps and two octahedral coordinates of the normal in 511ths.

use super::stroke::{
    MESH_EXPONENTS, MESH_UNITS_MAX, MeshPoint, NORMAL_UNITS, POINTS_MAX, PRESSURE_UNITS, Point,
    STROKES_MAX, UV_UNITS_MAX,
};
use super::{Brush, MeshPoints, Points, Stroke, Strokes};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD_NO_PAD;
use serde::de::Error as _;
use serde::ser::SerializeStruct;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::HashMap;
use std::ops::RangeInclusive;
use std::sync::Arc;

/// Strokes in a packed string, as we write it.
const RUN: usize = 64;
const ON_MESH: u64 = 1;
const PRESSURE_CHANGES: u64 = 2;

impl Serialize for Strokes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut brushes = Brushes::default();
        let mut packed = Vec::new();
        for run in self.strokes.chunks(RUN) {
            let mut bytes = Vec::new();
            for stroke in run {
                pack(stroke, brushes.number(stroke.brush()), &mut bytes);
            }
            packed.push(STANDARD_NO_PAD.encode(&bytes));
        }
        let mut table = serializer.serialize_struct("Strokes", 3)?;
        match &self.mesh {
            Some(mesh) => table.serialize_field("mesh", mesh)?,
            None => table.skip_field("mesh")?,
        }
        table.serialize_field("packed", &packed)?;
        table.serialize_field("brushes", &brushes.list)?;
        table.end()
    }
}

/// Each brush once, in the order of first use.
#[derive(Default)]
struct Brushes<'a> {
    list: Vec<&'a Brush>,
    by_place: HashMap<*const Brush, usize>,
    by_value: HashMap<String, usize>,
}

impl<'a> Brushes<'a> {
    fn number(&mut self, brush: &'a Arc<Brush>) -> usize {
        if let Some(n) = self.by_place.get(&Arc::as_ptr(brush)) {
            return *n;
        }
        let list = &mut self.list;
        let n = *self
            .by_value
            .entry(format!("{brush:?}"))
            .or_insert_with(|| {
                list.push(brush);
                list.len() - 1
            });
        self.by_place.insert(Arc::as_ptr(brush), n);
        n
    }
}

fn put(mut number: u64, bytes: &mut Vec<u8>) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

fn put_signed(number: i64, bytes: &mut Vec<u8>) {
    put(((number << 1) ^ (number >> 63)) as u64, bytes);
}

/// The numbers of a point that are stored as differences.
trait Numbers<const N: usize> {
    fn numbers(&self) -> [i64; N];
    fn pressure(&self) -> u16;
}

impl Numbers<2> for Point {
    fn numbers(&self) -> [i64; 2] {
        [self.x, self.y].map(i64::from)
    }
    fn pressure(&self) -> u16 {
        self.pressure
    }
}

impl Numbers<5> for MeshPoint {
    fn numbers(&self) -> [i64; 5] {
        let ([x, y, z], [n, m]) = (self.at.map(i64::from), self.normal.map(i64::from));
        [x, y, z, n, m]
    }
    fn pressure(&self) -> u16 {
        self.pressure
    }
}

fn pack(stroke: &Stroke, brush: usize, bytes: &mut Vec<u8>) {
    put(brush as u64, bytes);
    match stroke.points() {
        Points::Uv(points) => pack_points(points, 0, stroke.seed(), None, bytes),
        Points::Mesh(mesh) => {
            let exponent = Some(mesh.exponent);
            pack_points(&mesh.points, ON_MESH, stroke.seed(), exponent, bytes);
        }
    }
}

fn pack_points<const N: usize, P: Numbers<N>>(
    points: &[P],
    flags: u64,
    seed: u32,
    exponent: Option<i8>,
    bytes: &mut Vec<u8>,
) {
    let first = points.first().map_or(0, Numbers::pressure);
    let changes = points.iter().any(|p| p.pressure() != first);
    put(flags | if changes { PRESSURE_CHANGES } else { 0 }, bytes);
    put(u64::from(seed), bytes);
    put(points.len() as u64, bytes);
    if let Some(exponent) = exponent {
        put_signed(i64::from(exponent), bytes);
    }
    if !changes {
        put(u64::from(first), bytes);
    }
    let (mut before, mut pressure) = ([0; N], 0);
    for point in points {
        let numbers = point.numbers();
        if changes {
            put_signed(i64::from(point.pressure()) - pressure, bytes);
            pressure = i64::from(point.pressure());
        }
        for (n, b) in numbers.iter().zip(before) {
            put_signed(n - b, bytes);
        }
        before = numbers;
    }
}

/// What is wrong with packed bytes: a clause.
type Wrong = String;

/// Reads packed numbers; every read is checked.
struct Reader<'a> {
    bytes: &'a [u8],
}

impl Reader<'_> {
    fn number(&mut self) -> Result<u64, Wrong> {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let Some((byte, rest)) = self.bytes.split_first() else {
                return Err("it ends in the middle of a stroke".to_owned());
            };
            self.bytes = rest;
            number |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Ok(number);
            }
        }
        Err("a number in it has no end".to_owned())
    }

    fn in_range(&mut self, what: &str, range: RangeInclusive<u64>) -> Result<u64, Wrong> {
        let number = self.number()?;
        if range.contains(&number) {
            return Ok(number);
        }
        Err(format!(
            "{what} is {number}; allowed: {} to {}",
            range.start(),
            range.end()
        ))
    }

    fn signed(&mut self) -> Result<i64, Wrong> {
        let folded = self.number()?;
        Ok((folded >> 1) as i64 ^ -((folded & 1) as i64))
    }

    /// A number from its difference to the one before.
    fn next(&mut self, what: &str, before: i64, most: i64, least: i64) -> Result<i64, Wrong> {
        let number = before.saturating_add(self.signed()?);
        if (least..=most).contains(&number) {
            return Ok(number);
        }
        Err(format!(
            "{what} of a point is {number}; allowed: {least} to {most}"
        ))
    }
}

/// A stroke whose brush is known by its number only.
struct Unpacked {
    brush: u64,
    seed: u32,
    points: Points,
}

fn unpack(reader: &mut Reader<'_>) -> Result<Unpacked, Wrong> {
    let brush = reader.number()?;
    let flags = reader.in_range("the flags", 0..=ON_MESH | PRESSURE_CHANGES)?;
    let seed = reader.in_range("the seed", 0..=u64::from(u32::MAX))? as u32;
    let count = reader.in_range("the number of points", 1..=POINTS_MAX as u64)? as usize;
    let changes = flags & PRESSURE_CHANGES != 0;
    let points = if flags & ON_MESH == 0 {
        let points = read_points(reader, count, changes, |r, [x, y]: [i64; 2], pressure| {
            let most = i64::from(UV_UNITS_MAX);
            let (x, y) = (r.next("x", x, most, -most)?, r.next("y", y, most, -most)?);
            let point = Point {
                x: x as i32,
                y: y as i32,
                pressure,
            };
            Ok((point, [x, y]))
        })?;
        Points::Uv(points)
    } else {
        Points::Mesh(unpack_mesh(reader, count, changes)?)
    };
    Ok(Unpacked {
        brush,
        seed,
        points,
    })
}

fn unpack_mesh(reader: &mut Reader<'_>, count: usize, changes: bool) -> Result<MeshPoints, Wrong> {
    let exponent = reader.signed()?;
    let exponent = i8::try_from(exponent).ok();
    let Some(exponent) = exponent.filter(|e| MESH_EXPONENTS.contains(e)) else {
        return Err("its step on the mesh is out of range; allowed: 2^-60 to 2^60".to_owned());
    };
    let points = read_points(reader, count, changes, |r, before: [i64; 5], pressure| {
        let (far, lean) = (i64::from(MESH_UNITS_MAX), i64::from(NORMAL_UNITS));
        let mut numbers = [0; 5];
        for (n, (number, before)) in numbers.iter_mut().zip(before).enumerate() {
            let most = if n < 3 { far } else { lean };
            *number = r.next("a coordinate", before, most, -most)?;
        }
        let [x, y, z, n, m] = numbers;
        let point = MeshPoint {
            at: [x, y, z].map(|c| c as i32),
            normal: [n, m].map(|c| c as i16),
            pressure,
        };
        Ok((point, numbers))
    })?;
    Ok(MeshPoints { exponent, points })
}

/// Reads `count` points, each from the numbers of the one before.
fn read_points<const N: usize, P>(
    reader: &mut Reader<'_>,
    count: usize,
    changes: bool,
    mut read: impl FnMut(&mut Reader<'_>, [i64; N], u16) -> Result<(P, [i64; N]), Wrong>,
) -> Result<Vec<P>, Wrong> {
    let most = i64::from(PRESSURE_UNITS);
    let mut pressure = 0;
    if !changes {
        pressure = reader.in_range("the pressure", 0..=most as u64)? as i64;
    }
    // Every point takes a byte at least: no more is set aside than the text can fill.
    let mut points = Vec::with_capacity(count.min(reader.bytes.len()));
    let mut before = [0; N];
    for _ in 0..count {
        if changes {
            pressure = reader.next("the pressure", pressure, most, 0)?;
        }
        let (point, numbers) = read(reader, before, pressure as u16)?;
        before = numbers;
        points.push(point);
    }
    Ok(points)
}

/// The strokes of a packed string.
fn unpack_run(text: &str) -> Result<Vec<Unpacked>, Wrong> {
    let bytes = STANDARD_NO_PAD.decode(text).map_err(|e| {
        format!("holds no packed strokes: {e}; allowed: base64 as this program writes it")
    })?;
    let mut reader = Reader { bytes: &bytes };
    let mut strokes = Vec::new();
    while !reader.bytes.is_empty() {
        let n = strokes.len();
        let stroke = unpack(&mut reader);
        strokes.push(stroke.map_err(|wrong| format!("cannot be read at its stroke {n}: {wrong}"))?);
        if strokes.len() > STROKES_MAX {
            break; // too many, as the caller will find
        }
    }
    Ok(strokes)
}

/// A brush that was checked where it stands.
struct Checked(Arc<Brush>);

impl<'de> Deserialize<'de> for Checked {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let brush = Brush::deserialize(deserializer)?;
        brush.check().map_err(D::Error::custom)?;
        Ok(Self(Arc::new(brush)))
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    mesh: Option<String>,
    #[serde(default)]
    packed: Vec<String>,
    #[serde(default)]
    brushes: Vec<Checked>,
}

impl<'de> Deserialize<'de> for Strokes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let table = Table::deserialize(deserializer)?;
        let mut strokes = Vec::new();
        for (n, run) in table.packed.iter().enumerate() {
            let mistake = |wrong| D::Error::custom(format!("packed.{n} {wrong}"));
            for stroke in unpack_run(run).map_err(mistake)? {
                strokes.push(named(stroke, &table.brushes).map_err(mistake)?);
            }
            if strokes.len() > STROKES_MAX {
                return Err(D::Error::custom(format!(
                    "more than {STROKES_MAX} strokes are packed; allowed: at most that many in a layer"
                )));
            }
        }
        Ok(Self {
            strokes,
            mesh: table.mesh,
        })
    }
}

/// A stroke with its brush in place of the brush's number.
fn named(stroke: Unpacked, brushes: &[Checked]) -> Result<Arc<Stroke>, Wrong> {
    let brush = usize::try_from(stroke.brush).ok();
    let Some(Checked(brush)) = brush.and_then(|n| brushes.get(n)) else {
        return Err(format!(
            "has a stroke of brush {}; allowed: less than {}, the number of `brushes`",
            stroke.brush,
            brushes.len()
        ));
    };
    let mut points = stroke.points;
    points.dedup();
    Stroke::from_parts(Arc::clone(brush), stroke.seed, points)
        .map(Arc::new)
        .map_err(|e| e.to_string())
}
