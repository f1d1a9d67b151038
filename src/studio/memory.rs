//! What a map takes of memory, told before it is taken.

use crate::import::numbers;
use crate::map::Size;
use crate::mesh::{self, Projection};
use crate::recipe::{Files, Image, Recipe, Source, is_path};

/// Bytes a texel of the map: its planes, the same side by side (up to 4096x4096), the levels over it, and the canvas's own.
const MAP: u64 = 16;
const BESIDE: u64 = 16;
const LEVELS: u64 = 6;
const CANVAS: u64 = 6;
/// While a map is made the one before stands.
const MAKING: u64 = MAP + LEVELS;
/// What of a map has been painted on: what lies below, what strokes made of it, how much they touched.
const PAINTED: u64 = 36;
/// What the program takes whatever the map.
const PROGRAM: u64 = 200 << 20;

/// About how many bytes a studio takes that shows a recipe at a size, the whole map painted on where it has strokes.
pub fn bytes_needed(recipe: &Recipe, size: Size) -> u64 {
    let texels = size.texels() as u64;
    let is_painted = recipe
        .layers
        .iter()
        .any(|l| l.strokes(false).is_some() || l.strokes(true).is_some());
    let beside = if texels <= 1 << 24 { BESIDE } else { 0 };
    let painted = if is_painted { PAINTED } else { 0 };
    PROGRAM + texels * (MAP + beside + LEVELS + CANVAS + MAKING + painted)
}

/// Bytes of memory that are free for programs, where the system tells it.
pub fn bytes_free() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kib.checked_mul(1024)
}

/// What to tell before a map is made that takes much of the memory there is; `None` where there is nothing to tell: it takes
/// less than a gibibyte, or less than half of what is free.
pub fn memory_warning(recipe: &Recipe, size: Size, free: Option<u64>) -> Option<String> {
    warning(size, bytes_needed(recipe, size), free)
}

/// The same of a recipe as it is, with the pictures that its layers read, and with the mesh that it names.
pub fn document_warning(recipe: &Recipe, files: &Files, free: Option<u64>) -> Option<String> {
    let needed = bytes_needed(recipe, recipe.size) + pictures_bytes(recipe, files);
    let map = warning(recipe.size, needed, free);
    let told: Vec<String> = map
        .into_iter()
        .chain(named_mesh_warning(recipe, files, free))
        .collect();
    (!told.is_empty()).then(|| told.join("\n"))
}

/// Meshes in smaller files are not looked into before they are read, bytes.
const SMALL_MESH: u64 = 32 << 20;

/// What to tell of the mesh file that a recipe names.
fn named_mesh_warning(recipe: &Recipe, files: &Files, free: Option<u64>) -> Option<String> {
    let (name, _) = Projection::split(recipe.mesh.as_deref()?);
    if !is_path(name) {
        return None;
    }
    let path = files.resolve("mesh", name).ok()?;
    if std::fs::metadata(&path).ok()?.len() < SMALL_MESH {
        return None;
    }
    let triangles = mesh::about(&path).ok()?.triangles;
    let much = mesh_warning(triangles, free)?;
    Some(format!("{name} has {triangles} triangles. {much}"))
}

fn warning(size: Size, needed: u64, free: Option<u64>) -> Option<String> {
    let gib = |bytes: u64| bytes as f64 / f64::from(1 << 30);
    if needed < 1 << 30 || free.is_some_and(|free| needed <= free / 2) {
        return None;
    }
    let takes = format!(
        "A map of {size} takes about {:.1} GiB of memory",
        gib(needed)
    );
    Some(match free {
        None => format!("{takes}."),
        Some(free) if needed > free => format!(
            "{takes}, and {:.1} GiB are free: work at a smaller size, and generate the large map from the saved recipe.",
            gib(free)
        ),
        Some(free) => format!("{takes} of the {:.1} GiB that are free.", gib(free)),
    })
}

/// Bytes a triangle of a mesh, while it is read, given tangents, looked over and drawn; measured with meshes of ten million.
const TRIANGLE: u64 = 700;

/// What to tell before a mesh is read that takes more than half of the memory that is free; `None` where it takes less, or the
/// system does not tell what is free.
pub fn mesh_warning(triangles: usize, free: Option<u64>) -> Option<String> {
    let takes = over_half(triangles as u64 * TRIANGLE, free)?;
    Some(format!(
        "To paint on it takes {takes}. A mesh with fewer triangles shows the same map."
    ))
}

/// What is needed and what is free, where that is more than half of it.
fn over_half(needed: u64, free: Option<u64>) -> Option<String> {
    let free = free.filter(|free| needed > free / 2)?;
    let gib = |bytes: u64| bytes as f64 / f64::from(1 << 30);
    Some(format!(
        "about {:.1} GiB of memory; {:.1} GiB are free",
        gib(needed),
        gib(free)
    ))
}

/// Bytes a texel of a finished map, as it is read and reduced.
const PICTURE: u64 = 24;

/// Bytes that a picture of so many channels takes while it is read, and the map that is made of it: its numbers have at most
/// four bytes each.
fn picture_bytes(size: Size, channels: usize) -> u64 {
    size.texels() as u64 * (PICTURE + 4 * channels as u64)
}

/// What to tell before a picture is read that takes more than half of the memory that is free; `None` where it takes less, or
/// the system does not tell what is free.
pub fn picture_warning(size: Size, channels: usize, free: Option<u64>) -> Option<String> {
    let takes = over_half(picture_bytes(size, channels), free)?;
    Some(format!(
        "To read it takes {takes}. A smaller picture may show the same."
    ))
}

/// About how many bytes the pictures of a recipe's visible layers take, by what the files say of themselves. Those that cannot
/// be read take none.
pub fn pictures_bytes(recipe: &Recipe, files: &Files) -> u64 {
    let shown = recipe.layers.iter().filter(|l| l.visible);
    let images = shown.filter_map(|l| match &l.source {
        Source::Image(image) => Some(image),
        _ => None,
    });
    let of_file = |name: &String| {
        let path = files.resolve("file", name).ok()?;
        let about = numbers::about(&path).ok()?;
        Some((about.size, about.channels.len()))
    };
    let of_image = |image: &Image| {
        let mut names: Vec<&String> = image.files().collect();
        names.sort_unstable();
        names.dedup();
        let all: Vec<_> = names.into_iter().filter_map(of_file).collect();
        let channels = all.iter().map(|(_, n)| n).sum();
        all.first()
            .map_or(0, |(size, _)| picture_bytes(*size, channels))
    };
    images.map(of_image).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_large_map_is_told_before_it_is_made() {
        let recipe = Recipe::default();
        let size = |n: u32| Size::new(n, n).unwrap();
        assert_eq!(memory_warning(&recipe, size(2048), Some(1 << 20)), None);
        assert_eq!(memory_warning(&recipe, size(4096), Some(64 << 30)), None);
        let told = memory_warning(&recipe, size(16384), Some(16 << 30)).unwrap();
        assert!(
            told.contains("16384x16384") && told.contains("of the 16.0 GiB"),
            "{told}"
        );
        let told = memory_warning(&recipe, size(16384), Some(4 << 30)).unwrap();
        assert!(
            told.contains("4.0 GiB are free: work at a smaller size"),
            "{told}"
        );
        assert!(memory_warning(&recipe, size(16384), None).is_some());
    }

    #[test]
    fn a_large_mesh_that_a_recipe_names_is_told_too() {
        let folder = tempfile::tempdir().unwrap();
        let head = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n";
        let faces = "f 1/1 2/1 3/1\n".repeat(SMALL_MESH as usize / 14 + 1);
        std::fs::write(folder.path().join("m.obj"), head.to_owned() + &faces).unwrap();
        let text = "version = 1\nsize = 64\nmesh = 'm.obj'\n[[layers]]\nconstant = {}\n";
        let file = crate::recipe::RecipeFile::parse(text, "a.toml", Some(folder.path().to_owned()));
        let file = file.unwrap();
        let told = |free| document_warning(file.recipe(), &file.files(false), Some(free));
        assert_eq!(told(64 << 30), None);
        let said = told(1 << 30).unwrap();
        assert!(said.starts_with("m.obj has 2396746 triangles."), "{said}");
    }

    #[test]
    fn pictures_count_by_what_they_say_of_themselves() {
        let folder = tempfile::tempdir().unwrap();
        let size = Size::new(4096, 4096).unwrap();
        image::GrayImage::new(4096, 4096)
            .save(folder.path().join("r.png"))
            .unwrap();
        let text = "version = 1\nsize = 64\n[[layers]]\n[layers.image.textures]\nfirst.file = 'r.png'\nsecond.file = 'r.png'\n";
        let file = crate::recipe::RecipeFile::parse(text, "a.toml", Some(folder.path().to_owned()));
        let file = file.unwrap();
        let (recipe, files) = (file.recipe(), file.files(false));
        assert_eq!(pictures_bytes(recipe, &files), size.texels() as u64 * 28);
        assert_eq!(pictures_bytes(recipe, &Files::default()), 0);
        assert!(picture_warning(size, 1, Some(1 << 30)).is_none());
        assert!(picture_warning(size, 16, Some(1 << 30)).is_some());
        let tight = document_warning(recipe, &files, Some(1 << 30));
        assert!(tight.is_none(), "less than a gibibyte is not told");
    }

    #[test]
    fn a_large_mesh_is_told_before_it_is_read() {
        assert_eq!(mesh_warning(10_000_000, None), None);
        assert_eq!(mesh_warning(10_000, Some(1 << 30)), None);
        let told = mesh_warning(10_000_000, Some(4 << 30)).unwrap();
        assert!(told.contains("4.0 GiB are free"), "{told}");
    }
}
