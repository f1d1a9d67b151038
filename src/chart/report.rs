//! The files of a chart: CSV first, the pictures of it second, and a page that tells of both.

use super::kernels::{self, Effort, KernelRow};
use super::machine::Machine;
use super::pictures::{self, Keep, PictureRow};
use super::scatter::{Mark, Scatter, three_digits};
use crate::analyse::Flip;
use crate::analyse::limits::SPECULAR;
use crate::brdf::Model;
use crate::error::{Error, Result};
use crate::export::png::{write_grey16, write_picture};
use crate::export::{Written, write_atomic};
use crate::preview::Picture;
use crate::progress::Progress;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

/// What can be measured by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// One evaluation of a model: forms, exponentials, storage.
    Kernels,
    /// Whole pictures: models, storage, filters, samples.
    Pictures,
}

impl Part {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Kernels, Self::Pictures];

    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Kernels => "kernels",
            Self::Pictures => "pictures",
        }
    }
}

impl FromStr for Part {
    type Err = Error;

    fn from_str(word: &str) -> Result<Self> {
        let found = Self::ALL.into_iter().find(|p| p.name() == word);
        found.ok_or_else(|| {
            Error::invalid("part", format!("`{word}`"), "allowed: kernels, pictures")
        })
    }
}

/// What is measured, and how thoroughly.
#[derive(Clone, Debug)]
pub struct Options {
    /// Which parts; none stands for all.
    pub parts: Vec<Part>,
    /// Small pictures and few rounds: to see that all works, not to be believed.
    pub is_quick: bool,
    /// Keep every picture, and the map of its differences from the reference, in `pictures/`.
    pub keep_pictures: bool,
    /// The command that asked for it, to be written beside the numbers.
    pub command: String,
}

/// What was measured and written.
#[derive(Clone, Debug)]
pub struct Measured {
    /// On what.
    pub machine: Machine,
    /// Empty where kernels were not asked for.
    pub kernels: Vec<KernelRow>,
    /// Empty where pictures were not asked for.
    pub pictures: Vec<PictureRow>,
    /// The files, in the order they were written.
    pub files: Vec<Written>,
}

/// Measures and writes into `folder`, which is there already: `kernels.csv`, `pictures.csv`, an SVG file for each chart, and
/// `chart.md`.
///
/// # Errors
/// When a file cannot be written or `progress` cancels; what was written until then stays.
pub fn measure(folder: &Path, options: &Options, progress: &Progress<'_>) -> Result<Measured> {
    let wants = |part| options.parts.is_empty() || options.parts.contains(&part);
    let mut measured = Measured {
        machine: Machine::here(),
        kernels: Vec::new(),
        pictures: Vec::new(),
        files: Vec::new(),
    };
    let mut charts = Vec::new();
    if wants(Part::Kernels) {
        let effort = effort(options.is_quick, 400, 150);
        measured.kernels = kernels::measure(effort, progress)?;
        let csv = kernels_csv(&measured.kernels);
        measured.files.push(write(folder, "kernels.csv", &csv)?);
        charts.extend(kernel_charts(&measured));
    }
    if wants(Part::Pictures) {
        let effort = effort(options.is_quick, 60, 250);
        let mut keep = Kept {
            folder: options.keep_pictures.then(|| folder.join("pictures")),
            files: Vec::new(),
        };
        keep.make_folder()?;
        measured.pictures = pictures::measure(effort, options.is_quick, &mut keep, progress)?;
        measured.files.append(&mut keep.files);
        let csv = pictures_csv(&measured.pictures);
        measured.files.push(write(folder, "pictures.csv", &csv)?);
        charts.extend(picture_charts(&measured));
    }
    for (name, chart) in &charts {
        measured.files.push(write(folder, name, &chart.svg())?);
    }
    let page = page(&measured, options, &charts);
    measured.files.push(write(folder, "chart.md", &page)?);
    Ok(measured)
}

fn effort(is_quick: bool, rounds: usize, milliseconds: u64) -> Effort {
    if is_quick {
        return Effort {
            rounds: 1,
            time: Duration::ZERO,
        };
    }
    Effort {
        rounds,
        time: Duration::from_millis(milliseconds),
    }
}

fn write(folder: &Path, name: &str, text: &str) -> Result<Written> {
    write_atomic(&folder.join(name), |file| file.write_all(text.as_bytes()))
}

/// Where pictures go, if anywhere.
struct Kept {
    folder: Option<PathBuf>,
    files: Vec<Written>,
}

impl Kept {
    fn make_folder(&self) -> Result<()> {
        let Some(folder) = &self.folder else {
            return Ok(());
        };
        std::fs::create_dir_all(folder).map_err(Error::write(folder))
    }
}

/// Words to a file's name.
fn file_name(words: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
    let name: String = words.to_lowercase().chars().map(plain).collect();
    let parts: Vec<&str> = name.split('-').filter(|p| !p.is_empty()).collect();
    parts.join("-")
}

impl Keep for Kept {
    fn picture(&mut self, name: &str, picture: &Picture) -> Result<Option<String>> {
        let Some(folder) = &self.folder else {
            return Ok(None);
        };
        let name = format!("{}.png", file_name(name));
        self.files
            .push(write_picture(&folder.join(&name), picture)?);
        Ok(Some(format!("pictures/{name}")))
    }

    fn difference(&mut self, name: &str, flip: &Flip) -> Result<()> {
        if let Some(folder) = &self.folder {
            let path = folder.join(format!("{}-flip.png", file_name(name)));
            self.files
                .push(write_grey16(&path, flip.size(), flip.values())?);
        }
        Ok(())
    }
}

/// Lines of comma-separated words; none of ours has a comma or a quote.
fn csv(head: &str, rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut text = format!("{head}\n");
    for row in rows {
        let row: Vec<String> = row
            .iter()
            .map(|w| w.replace([',', '"', '\n'], " "))
            .collect();
        text += &row.join(",");
        text.push('\n');
    }
    text
}

fn kernels_csv(rows: &[KernelRow]) -> String {
    let head = "model,form,exp,storage,bytes,level,ns_min,ns_median,max_rel,mean_rel";
    let rows = rows.iter().map(|r| {
        vec![
            r.model.to_owned(),
            r.form.to_owned(),
            r.exp.to_owned(),
            r.storage.clone(),
            r.bytes.to_string(),
            r.level.to_owned(),
            format!("{:.4}", r.ns_min),
            format!("{:.4}", r.ns_median),
            format!("{:.3e}", r.max_rel),
            format!("{:.3e}", r.mean_rel),
        ]
    });
    csv(head, rows)
}

fn pictures_csv(rows: &[PictureRow]) -> String {
    let head = "scene,group,method,look,storage,bytes,samples,ms_min,ms_median,flip_mean,flip_p999,flip_max,de_mean,\
                de_p999,de_max,flip_base,de_base,png,png_flip_mean";
    let rows = rows.iter().map(|r| {
        vec![
            r.scene.to_owned(),
            r.group.to_owned(),
            r.method.replace(", ", " "),
            r.look.clone(),
            r.storage.clone(),
            r.bytes.to_string(),
            r.samples.to_string(),
            format!("{:.4}", r.ms_min),
            format!("{:.4}", r.ms_median),
            format!("{:.6}", r.flip_mean),
            format!("{:.5}", r.flip_p999),
            format!("{:.5}", r.flip_max),
            format!("{:.5}", r.de_mean),
            format!("{:.4}", r.de_p999),
            format!("{:.4}", r.de_max),
            format!("{:.6}", r.flip_base),
            format!("{:.5}", r.de_base),
            r.png.clone().unwrap_or_default(),
            r.png_flip_mean
                .map(|f| format!("{f:.6}"))
                .unwrap_or_default(),
        ]
    });
    csv(head, rows)
}

/// A chart with the name of its file.
type Chart = (String, Scatter);

/// The group that a word belongs to: the words in the order they are met.
fn group(groups: &mut Vec<String>, word: &str) -> usize {
    groups.iter().position(|g| g == word).unwrap_or_else(|| {
        groups.push(word.to_owned());
        groups.len() - 1
    })
}

fn kernel_chart(
    name: &str,
    title: &str,
    subtitle: String,
    rows: &[&KernelRow],
    label: impl Fn(&KernelRow) -> (String, String),
) -> Chart {
    let mut groups = Vec::new();
    let marks = rows
        .iter()
        .map(|row| {
            let (word, name) = label(row);
            Mark {
                name,
                group: group(&mut groups, &word),
                x: row.ns_min,
                y: vec![row.max_rel, row.mean_rel],
            }
        })
        .collect();
    let chart = Scatter {
        title: title.to_owned(),
        subtitle,
        x: ("nanoseconds per evaluation, one thread", "ns"),
        y: vec![
            ("largest error relative to f64", "largest"),
            ("mean error relative to f64", "mean"),
        ],
        groups,
        marks,
    };
    (name.to_owned(), chart)
}

/// Words, and the exponential where there is one.
fn with_exponential(words: &str, row: &KernelRow) -> String {
    match row.exp {
        "none" => words.to_owned(),
        exp => format!("{words}, {exp}"),
    }
}

/// Of every model the forms with their exponentials and the storages; and the exponentials of all models side by side.
fn kernel_charts(measured: &Measured) -> Vec<Chart> {
    let machine = measured.machine.line();
    let rows = |wanted: &dyn Fn(&KernelRow) -> bool| -> Vec<&KernelRow> {
        measured.kernels.iter().filter(|r| wanted(r)).collect()
    };
    let best = crate::math::levels()
        .last()
        .map_or("baseline", |(name, _)| name);
    let models = rows(&|r| r.form == "prepared" && r.level == best);
    let mut charts = vec![kernel_chart(
        "kernels-models.svg",
        "One evaluation of each model: exponentials",
        format!("{machine}; prepared f32 texels, vector loops at {best}"),
        &models,
        |r| {
            // The two without a direction share a shape.
            let word = match r.model {
                "phong" | "blinn-phong" => "phong, blinn-phong",
                model => model,
            };
            (word.to_owned(), with_exponential(r.model, r))
        },
    )];
    for model in SPECULAR.map(Model::name) {
        let forms = rows(&|r| r.model == model && r.form != "decoded");
        charts.push(kernel_chart(
            &format!("kernels-forms-{model}.svg"),
            &if forms.iter().all(|r| r.exp == "none") {
                format!("One evaluation of {model}: forms")
            } else {
                format!("One evaluation of {model}: forms and exponentials")
            },
            format!("{machine}; f32 texels, vector loops at {best} unless another level is named"),
            &forms,
            |r| {
                let level = match r.level {
                    level if level == best || level == "scalar" => String::new(),
                    level => format!(", {level}"),
                };
                (r.form.to_owned(), with_exponential(r.form, r) + &level)
            },
        ));
    }
    for model in SPECULAR.map(Model::name) {
        charts.push(kernel_chart(
            &format!("kernels-storage-{model}.svg"),
            &format!("One evaluation of {model}: storage of the texel, decoded before it"),
            format!("{machine}; vector loops at {best}; bytes of a texel after its storage"),
            &rows(&|r| r.model == model && r.form == "decoded"),
            |r| {
                let name = format!("{}, {} B", r.storage, r.bytes);
                (depth(&r.storage).to_owned(), name)
            },
        ));
    }
    charts
}

fn picture_charts(measured: &Measured) -> Vec<Chart> {
    let mut scenes: Vec<&str> = measured.pictures.iter().map(|r| r.scene).collect();
    scenes.dedup();
    let mut charts: Vec<Chart> = scenes
        .into_iter()
        .map(|scene| {
            let mut groups = Vec::new();
            let rows = measured.pictures.iter().filter(|r| r.scene == scene);
            let marks = rows.map(|r| Mark {
                name: r.method.clone(),
                group: group(&mut groups, r.group),
                x: r.ms_min,
                y: vec![r.flip_mean, r.de_mean],
            });
            let marks = marks.collect();
            let chart = Scatter {
                title: format!(
                    "A picture of the {scene}: what each way to draw it costs, and its error"
                ),
                subtitle: format!(
                    "{}; error from the reference picture; each way is the base with one change; storages are decoded before the frame",
                    measured.machine.line()
                ),
                x: ("milliseconds per frame, all threads", "ms"),
                y: vec![
                    ("mean FLIP from the reference", "FLIP"),
                    ("mean CIEDE2000 from the reference", "\u{394}E00"),
                ],
                groups,
                marks,
            };
            (format!("pictures-{}.svg", file_name(scene)), chart)
        })
        .collect();
    charts.push(storage_chart(measured));
    charts
}

/// Bytes of a texel against error: what reduction trades. The error is that of the storage alone, since from the reference it
/// would drown in what 2x2 samples leave, and that of the subject which shows it most.
fn storage_chart(measured: &Measured) -> Chart {
    let rows = || measured.pictures.iter().filter(|r| r.group == "storage");
    let mut storages: Vec<(&str, usize)> = Vec::new();
    for row in rows() {
        if storages.iter().all(|(name, _)| *name != row.storage) {
            storages.push((&row.storage, row.bytes));
        }
    }
    let mut groups = Vec::new();
    let marks = storages.into_iter().map(|(storage, bytes)| {
        let worst = |error: fn(&PictureRow) -> f64| {
            let errors = rows().filter(|r| r.storage == storage).map(error);
            errors.fold(0.0, f64::max)
        };
        Mark {
            name: storage.to_owned(),
            group: group(&mut groups, depth(storage)),
            x: bytes as f64,
            y: vec![worst(|r| r.flip_base), worst(|r| r.de_base)],
        }
    });
    let chart = Scatter {
        marks: marks.collect(),
        title: "Storage of the map: bytes of a texel, and what that alone does to the picture".into(),
        subtitle: "error from the same picture with the map as f32 (16 bytes), of the subject that shows it most".into(),
        x: ("bytes per texel", "bytes"),
        y: vec![
            ("mean FLIP from f32", "FLIP"),
            ("mean CIEDE2000 from f32", "\u{394}E00"),
        ],
        groups,
    };
    ("pictures-storage.svg".into(), chart)
}

/// The bits of a storage's widths: the first word of its name.
fn depth(storage: &str) -> &str {
    storage.split(['-', '/']).next().unwrap_or_default()
}

/// The page: what was measured on what, the charts, and the front of each.
fn page(measured: &Measured, options: &Options, charts: &[Chart]) -> String {
    let mut text = String::from("# Speed against accuracy, measured\n\n");
    text += &measured.machine.signature(&options.command);
    text += "\n\n";
    if options.is_quick {
        text += "A quick run: small pictures and single rounds. It shows that all works; its times say nothing.\n\n";
    }
    text += "Each chart shows cost against error, both logarithmic; nothing else is both faster and nearer than the points on \
             its dashed line. The numbers are in the CSV files beside it.\n";
    for (name, chart) in charts {
        let _ = writeln!(text, "\n## {}\n\n![{}]({name})\n", chart.title, chart.title);
        text += &front_table(chart);
    }
    if !measured.kernels.is_empty() {
        text += &level_table(&measured.kernels);
    }
    text
}

/// The points on a chart's front, for its first error.
fn front_table(chart: &Scatter) -> String {
    let values: Vec<(f64, f64)> = chart.marks.iter().map(|m| (m.x, m.y[0])).collect();
    let mut text = format!("| on the front | {} |", chart.x.1);
    for (_, word) in &chart.y {
        let _ = write!(text, " {word} |");
    }
    text += "\n|---|---|";
    text += &"---|".repeat(chart.y.len());
    text.push('\n');
    for i in super::scatter::front(&values) {
        let mark = &chart.marks[i];
        let _ = write!(text, "| {} | {} |", mark.name, three_digits(mark.x));
        for y in &mark.y {
            let _ = write!(text, " {} |", three_digits(*y));
        }
        text.push('\n');
    }
    text
}

/// The program's own kernels at each CPU level.
fn level_table(rows: &[KernelRow]) -> String {
    let levels: Vec<&str> = crate::math::levels()
        .into_iter()
        .map(|(name, _)| name)
        .collect();
    let own = |r: &&KernelRow| r.is_own();
    let mut text = String::from(
        "\n## The program's own kernels at each CPU level\n\nNanoseconds per evaluation, one thread; every level gives the \
         same bits.\n\n| model |",
    );
    for level in &levels {
        let _ = write!(text, " {level} |");
    }
    text += " largest error |\n|---|";
    text += &"---|".repeat(levels.len() + 1);
    text.push('\n');
    let first = rows.iter().filter(own).filter(|r| r.level == levels[0]);
    for row in first {
        let _ = write!(text, "| {} |", row.model);
        for level in &levels {
            let at = |r: &&KernelRow| r.model == row.model && r.level == *level;
            let found = rows.iter().filter(own).find(at);
            let _ = write!(
                text,
                " {} |",
                found.map_or_else(String::new, |r| three_digits(r.ns_min))
            );
        }
        let _ = writeln!(text, " {} |", three_digits(row.max_rel));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_are_plain() {
        assert_eq!(
            file_name("Pot base: ward, f32, 2x2"),
            "pot-base-ward-f32-2x2"
        );
        assert_eq!(file_name("../u8-log/u8"), "u8-log-u8");
    }

    #[test]
    fn words_with_commas_stay_in_their_column() {
        let text = csv(
            "a,b",
            [vec!["x,y".to_owned(), "z\n".to_owned()]].into_iter(),
        );
        assert_eq!(text, "a,b\nx y,z \n");
    }
}
