//! What the studio remembers from one start to the next: a small TOML file of our own in the user's settings folder.
//!
//! A file that cannot be read never stops the studio: it is told, renamed to `settings.toml.broken`, and the defaults serve.

use super::orbit::Preset;
use crate::error::{Error, Result};
use crate::export::{beside, real_path, write_atomic};
use crate::recipe::{Target, read_toml};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::{env, fs};

/// The environment variable that puts settings and recovery files into another folder.
pub const FOLDER_VARIABLE: &str = "ANISOMAP_CONFIG";
/// The most recent files that are remembered.
const RECENT_MAX: usize = 12;

/// Where the studio keeps what is not the user's own document.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Folders {
    /// Settings and keymap.
    pub config: PathBuf,
    /// Journals of unsaved work.
    pub recovery: PathBuf,
}

impl Folders {
    /// All of it below one folder.
    pub fn below(folder: &Path) -> Self {
        Self {
            config: folder.to_owned(),
            recovery: folder.join("recovery"),
        }
    }

    /// Where the system wants them, or below [`FOLDER_VARIABLE`] where that is set. `None` where the user has no home.
    pub fn find() -> Option<Self> {
        if let Some(folder) = env::var_os(FOLDER_VARIABLE).filter(|f| !f.is_empty()) {
            return Some(Self::below(Path::new(&folder)));
        }
        let dirs = directories::ProjectDirs::from("", "", "anisomap")?;
        Some(Self {
            config: dirs.config_dir().to_owned(),
            recovery: dirs.data_local_dir().join("recovery"),
        })
    }

    /// The settings file.
    pub fn settings(&self) -> PathBuf {
        self.config.join("settings.toml")
    }

    /// The keymap file.
    pub fn keymap(&self) -> PathBuf {
        self.config.join("keys.toml")
    }
}

/// Light or dark.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Theme {
    /// Dark, whatever the system says.
    #[default]
    Dark,
    /// Light, whatever the system says.
    Light,
    /// As the system says.
    System,
}

/// What is remembered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Light or dark. Default dark.
    pub theme: Theme,
    /// Size of text and controls, 0.5 to 4; default 1.
    pub scale: f32,
    /// Memory for undo in MiB, 16 to 65536; default 512.
    pub undo_memory: u32,
    /// Which mouse buttons turn and move the 3D view.
    pub navigation: Preset,
    /// Width and height of the window in points, 640 to 16384 and 480 to 16384.
    pub window: [f32; 2],
    /// Whether the hint over a new document was closed.
    pub hint_closed: bool,
    /// Files opened or saved lately, the latest first; at most 12.
    #[serde(with = "super::paths::list")]
    pub recent: Vec<PathBuf>,
    /// What the export dialog was last set to.
    pub export: ExportSettings,
}

/// What the export dialog was last set to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExportSettings {
    /// Where files go. Default: none yet, so it is asked.
    #[serde(with = "super::paths::maybe", skip_serializing_if = "Option::is_none")]
    pub folder: Option<PathBuf>,
    /// What is written. Default: what the recipe says.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub targets: Vec<Target>,
    /// Whether OpenEXR files hold 32-bit floats in place of halves. Default false.
    pub float: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            theme: Theme::default(),
            scale: 1.0,
            undo_memory: 512,
            navigation: Preset::default(),
            window: [1440.0, 900.0],
            hint_closed: false,
            recent: Vec::new(),
            export: ExportSettings::default(),
        }
    }
}

impl Settings {
    /// Reads the settings. What is wrong with the file comes beside the defaults, after the file was set aside.
    pub fn load(path: &Path) -> (Self, Option<Error>) {
        if !path.exists() {
            return (Self::default(), None);
        }
        match read_toml::<Self>(path) {
            Ok(settings) => (settings.within_limits(), None),
            Err(error) => {
                let aside = beside(path, ".broken");
                let told = match fs::rename(path, &aside) {
                    Ok(()) => format!(
                        "The file was set aside as {} and the defaults serve",
                        aside.display()
                    ),
                    Err(_) => "The defaults serve".to_owned(),
                };
                (Self::default(), Some(error.with_hint(told)))
            }
        }
    }

    /// Writes the settings; the folder is made where it is missing.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn save(&self, path: &Path) -> Result<()> {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(Error::write(folder))?;
        }
        let text = toml::to_string(self)
            .map_err(|e| Error::write(path)(std::io::Error::other(e.to_string())))?;
        write_atomic(&real_path(path), |out| out.write_all(text.as_bytes()))?;
        Ok(())
    }

    /// Puts a file at the head of the recent ones.
    pub fn remember(&mut self, path: &Path) {
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        self.recent.retain(|p| *p != path);
        self.recent.insert(0, path);
        self.recent.truncate(RECENT_MAX);
    }

    /// The memory for undo in bytes.
    pub fn undo_bytes(&self) -> usize {
        (self.undo_memory as usize) << 20
    }

    /// A number out of its range is brought to the nearest that is allowed: a window of no size would help nobody.
    fn within_limits(mut self) -> Self {
        let clamp = |value: f32, low: f32, high: f32, default: f32| {
            if value.is_finite() {
                value.clamp(low, high)
            } else {
                default
            }
        };
        self.scale = clamp(self.scale, 0.5, 4.0, 1.0);
        self.undo_memory = self.undo_memory.clamp(16, 65536);
        self.window = [
            clamp(self.window[0], 640.0, 16384.0, 1440.0),
            clamp(self.window[1], 480.0, 16384.0, 900.0),
        ];
        self.recent.truncate(RECENT_MAX);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_saved_is_loaded() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/settings.toml");
        let mut settings = Settings {
            theme: Theme::Light,
            scale: 1.25,
            navigation: Preset::Middle,
            ..Settings::default()
        };
        settings.export.targets = vec![Target::Exr, Target::Glb];
        settings.remember(&folder.path().join("a.toml"));
        settings.save(&path).unwrap();
        let (back, error) = Settings::load(&path);
        assert!(error.is_none());
        assert_eq!(back, settings);
        let (none, error) = Settings::load(&folder.path().join("none"));
        assert!(none == Settings::default() && error.is_none());
    }

    #[cfg(unix)]
    #[test]
    fn a_path_that_is_no_unicode_is_remembered() {
        use std::os::unix::ffi::OsStrExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("settings.toml");
        let name = std::ffi::OsStr::from_bytes(b"/nowhere/caf\xe9.toml");
        let mut settings = Settings::default();
        settings.remember(Path::new(name));
        settings.remember(Path::new("/nowhere/caf\u{e9}.toml"));
        settings.export.folder = Some(name.into());
        settings.save(&path).unwrap();
        let (back, error) = Settings::load(&path);
        assert!(error.is_none());
        assert_eq!(back, settings);
        assert_eq!(back.recent[1], Path::new(name));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (folder.path().join("real"), folder.path().join("link"));
        fs::write(&real, "").unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        Settings::default().save(&link).unwrap();
        assert!(link.is_symlink() && !fs::read(&real).unwrap().is_empty());
    }

    #[test]
    fn a_broken_file_is_told_and_set_aside() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("settings.toml");
        for broken in ["theme = \"purple\"", "scael = 2", "\u{0}\u{1}", "scale = ["] {
            fs::write(&path, broken).unwrap();
            let (settings, error) = Settings::load(&path);
            assert_eq!(settings, Settings::default());
            let told = error.expect(broken).to_string();
            assert!(told.contains("settings.toml.broken"), "{told}");
            assert!(!path.exists());
        }
    }

    #[test]
    fn numbers_out_of_range_are_brought_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("settings.toml");
        fs::write(&path, "scale = nan\nundo_memory = 1\nwindow = [0.0, inf]").unwrap();
        let (settings, error) = Settings::load(&path);
        assert!(error.is_none());
        assert_eq!((settings.scale, settings.undo_memory), (1.0, 16));
        assert_eq!(settings.window, [640.0, 900.0]);
    }

    #[test]
    fn recent_files_are_few_and_each_once() {
        let mut settings = Settings::default();
        for n in 0..30 {
            settings.remember(Path::new(&format!("/nowhere/{}.toml", n % 20)));
        }
        assert_eq!(settings.recent.len(), 12);
        assert_eq!(settings.recent[0], Path::new("/nowhere/9.toml"));
        settings.remember(Path::new("/nowhere/5.toml"));
        assert_eq!(settings.recent[0], Path::new("/nowhere/5.toml"));
        assert_eq!(settings.recent.len(), 12);
    }
}
