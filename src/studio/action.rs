//! Everything that a key, a button or a menu can do, in one table: its word in the keymap file, its name, what it does, and its
//! default keys. Menus, tooltips, the list of shortcuts and the keymap all read from here, so they cannot disagree.

use crate::error::{Error, Result, nearest_word};
use std::str::FromStr;

/// What actions are listed under.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Group {
    /// Documents and files.
    File,
    /// Undo and the like.
    Edit,
    /// The stack of layers.
    Layer,
    /// What the pointer does on the canvas.
    Tool,
    /// The brush's numbers.
    Brush,
    /// What the canvas shows.
    View,
    /// What the 3D picture shows.
    Viewport,
    /// Panels, themes and help.
    Window,
}

impl Group {
    /// Every group, in the order they are listed.
    pub const ALL: [Self; 8] = [
        Self::File,
        Self::Edit,
        Self::Layer,
        Self::Tool,
        Self::Brush,
        Self::View,
        Self::Viewport,
        Self::Window,
    ];

    /// Its heading.
    pub fn name(self) -> &'static str {
        match self {
            Self::File => "File",
            Self::Edit => "Edit",
            Self::Layer => "Layers",
            Self::Tool => "Tools",
            Self::Brush => "Brush",
            Self::View => "Canvas views",
            Self::Viewport => "3D view",
            Self::Window => "Window",
        }
    }
}

/// Writes the enum and its table together.
macro_rules! actions {
    ($($group:ident { $($variant:ident $word:literal $name:literal $doc:literal [$($keys:literal),*])* })*) => {
        /// Something that a key, a button or a menu can do.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Action {
            $($(#[doc = $doc] $variant,)*)*
        }

        impl Action {
            /// Every action, by group.
            pub const ALL: &[Self] = &[$($(Self::$variant,)*)*];

            fn entry(self) -> &'static Entry {
                match self {
                    $($(Self::$variant => &Entry {
                        group: Group::$group, word: $word, name: $name, doc: $doc, keys: &[$($keys),*],
                    },)*)*
                }
            }
        }
    };
}

struct Entry {
    group: Group,
    word: &'static str,
    name: &'static str,
    doc: &'static str,
    keys: &'static [&'static str],
}

actions! {
    File {
        New "new" "New…" "Begins an empty document" ["Ctrl+N"]
        Open "open" "Open…" "Opens a recipe, a map or a mesh" ["Ctrl+O"]
        Save "save" "Save" "Saves the recipe under its name" ["Ctrl+S"]
        SaveAs "save_as" "Save as…" "Saves the recipe under another name" ["Ctrl+Shift+S"]
        Presets "presets" "Presets…" "Shows the built-in recipes" ["Ctrl+P"]
        Import "import" "Import map or textures…" "Lays a finished map, or the textures of another program, over what is there as a layer" ["Ctrl+I"]
        LoadMesh "load_mesh" "Load mesh…" "Shows the map on a GLB, glTF or OBJ mesh" ["Ctrl+M"]
        Export "export" "Export…" "Writes files for other programs" ["Ctrl+Shift+E"]
        ExportAgain "export_again" "Export again" "Writes the same files as the last time; asks only where another program has changed them" ["Ctrl+E"]
        Quit "quit" "Quit" "Closes the window; asks when work is not saved" ["Ctrl+Q"]
    }
    Edit {
        Undo "undo" "Undo" "Takes the last change back" ["Ctrl+Z"]
        Redo "redo" "Redo" "Makes the change again that was taken back" ["Ctrl+Y", "Ctrl+Shift+Z"]
        Cancel "cancel" "Cancel" "Leaves what is being done: a stroke, a drag, a dialog" ["Escape"]
        Settings "settings" "Settings…" "Theme, scale, memory for undo, mouse buttons" ["Ctrl+Comma"]
    }
    Layer {
        NewPaintLayer "new_paint_layer" "New paint layer" "Adds a layer for strokes above the selected one" ["Ctrl+Shift+N"]
        NewGuideLayer "new_guide_layer" "New guide layer" "Adds a layer of editable guides above the selected one" ["Ctrl+Shift+G"]
        DuplicateLayer "duplicate_layer" "Duplicate layer" "Adds a copy of the selected layer above it" ["Ctrl+J"]
        MergeDown "merge_down" "Merge down" "Makes one of the selected layer and the one below it" ["Ctrl+Shift+M"]
        DeleteLayer "delete_layer" "Delete layer" "Takes the selected layer away" ["Delete"]
        RenameLayer "rename_layer" "Rename layer" "Gives the selected layer another name" ["Ctrl+R"]
        RaiseLayer "raise_layer" "Raise layer" "Moves the selected layer up by one" ["Ctrl+CloseBracket"]
        LowerLayer "lower_layer" "Lower layer" "Moves the selected layer down by one" ["Ctrl+OpenBracket"]
        SelectAbove "select_above" "Select layer above" "Selects the next layer up" ["PageUp"]
        SelectBelow "select_below" "Select layer below" "Selects the next layer down" ["PageDown"]
        ToggleLayer "toggle_layer" "Show or hide layer" "Shows or hides the selected layer" ["H"]
        SoloLayer "solo_layer" "Solo layer" "Shows the selected layer alone; again shows all" ["Slash"]
    }
    Tool {
        ToolGroove "tool_groove" "Groove" "Lays grooves along the stroke, with the widths along and across" ["B"]
        ToolComb "tool_comb" "Comb" "Turns the direction that is there toward the stroke" ["K"]
        ToolSmooth "tool_smooth" "Smooth" "Evens widths and directions out" ["S"]
        ToolRoughen "tool_roughen" "Roughen" "Makes both widths larger" ["R"]
        ToolPolish "tool_polish" "Polish" "Makes both widths smaller" ["P"]
        ToolSetAlpha "tool_set_alpha" "Set alpha" "Paints the widths and leaves the direction" ["A"]
        ToolSetDirection "tool_set_direction" "Set direction" "Turns the x axis to one angle and leaves the widths" ["Q"]
        ToolErase "tool_erase" "Erase" "Takes strokes of this layer away" ["E"]
        ToolFill "tool_fill" "Fill" "Fills the whole layer with the brush's widths and direction" ["G"]
        ToolPick "tool_pick" "Pick" "Takes widths and direction from under the pointer for every tool, and gives the tool before it back" ["V", "I"]
        ToolScratch "tool_scratch" "Scratch" "Scatters fine scratches along the stroke" ["T"]
        ToolGuide "tool_guide" "Guide" "Draws and edits guides that the direction follows" ["U"]
    }
    Brush {
        SizeDown "size_down" "Smaller" "Makes the brush smaller" ["OpenBracket"]
        SizeUp "size_up" "Larger" "Makes the brush larger" ["CloseBracket"]
        HardnessDown "hardness_down" "Softer" "Makes the brush's edge softer" ["Shift+OpenBracket"]
        HardnessUp "hardness_up" "Harder" "Makes the brush's edge harder" ["Shift+CloseBracket"]
        FlowDown "flow_down" "Less flow" "Makes a stroke leave less" ["Minus"]
        FlowUp "flow_up" "More flow" "Makes a stroke leave more" ["Equals"]
        DragSize "drag_size" "Drag size" "Moving the pointer sideways changes the brush's size, up and down its hardness; click to take it" ["F"]
        DragFlow "drag_flow" "Drag flow" "Moving the pointer sideways changes the flow; click to take it" ["Shift+F"]
        SwapAlphas "swap_alphas" "Swap along and across" "Exchanges the width along the stroke and the one across it" ["X"]
        ToggleMirror "toggle_mirror" "Mirror" "Paints a mirror image of every stroke" ["L"]
        ToggleRadial "toggle_radial" "Radial symmetry" "Repeats every stroke around the middle" ["Shift+L"]
        ToggleStabiliser "toggle_stabiliser" "Stabiliser" "Draws calm lines with an unsteady hand" ["D"]
    }
    View {
        View1 "view_1" "Lit" "Shows the map lit from a light that you can drag" ["1"]
        View2 "view_2" "alpha_x" "Shows the width along the x axis in false colour" ["2"]
        View3 "view_3" "alpha_y" "Shows the width across the x axis in false colour" ["3"]
        View4 "view_4" "Ratio" "Shows the larger width over the smaller one in false colour" ["4"]
        View5 "view_5" "Direction" "Shows the direction as a hue that returns after 180 degrees" ["5"]
        View6 "view_6" "Grain" "Shows the direction as streaks along it" ["6"]
        View7 "view_7" "Strokes" "Shows the x axis as short lines over the lit map" ["7"]
        View8 "view_8" "Coverage" "Shows where the selected layer covers those below it" ["8"]
        View9 "view_9" "Lint" "Marks texels out of range, poles, singular points and seams" ["9"]
        CycleView "cycle_view" "Next view" "Goes through the canvas views" ["C"]
        ViewLit "view_lit" "Back to lit" "Shows the lit map again" ["M"]
        ToggleWrap "toggle_wrap" "Wrap view" "Shows the map side by side with itself, as it repeats" ["W"]
        ToggleOutlines "toggle_outlines" "UV outlines" "Shows over the map where the charts of the mesh end" ["O"]
        CanvasFit "canvas_fit" "Whole map" "Shows the whole map in the canvas" ["0"]
        ActualTexels "actual_texels" "Actual texels" "Shows one texel on one pixel" ["Ctrl+1"]
        ZoomIn "zoom_in" "Zoom in" "Shows the map larger" ["Ctrl+Equals", "Ctrl+Plus"]
        ZoomOut "zoom_out" "Zoom out" "Shows the map smaller" ["Ctrl+Minus"]
    }
    Viewport {
        FrameAll "frame_all" "Frame all" "Brings the whole mesh and the whole map into view" ["Home", "Period"]
        NextMesh "next_mesh" "Next mesh" "Shows the map on the next built-in mesh" ["N"]
        NextModel "next_model" "Next model" "Shows the next reflection model" ["J"]
        Compare "compare" "Compare" "Shows two models side by side" ["Y"]
        Difference "difference" "Difference" "Shows where two models differ" ["Shift+Y"]
        ExposureDown "exposure_down" "Darker" "Lowers the exposure by a third of a stop" ["Shift+Comma"]
        ExposureUp "exposure_up" "Brighter" "Raises the exposure by a third of a stop" ["Shift+Period"]
        ResetLight "reset_light" "Reset light" "Puts the lights back" ["Shift+Home"]
        ToggleTimings "toggle_timings" "Timings" "Shows over the 3D view how long each stage of its last drawing took; those that go tile by tile are summed over the cores" ["F9"]
    }
    Window {
        Shortcuts "shortcuts" "Shortcuts" "Lists every key and mouse gesture" ["F1"]
        ShowBoth "show_both" "Canvas and 3D view" "Shows canvas and 3D view side by side" ["F2"]
        ShowCanvas "show_canvas" "Canvas alone" "Shows the canvas alone" ["F3"]
        ShowViewport "show_viewport" "3D view alone" "Shows the 3D view alone" ["F4"]
        FocusControls "focus_controls" "Go to the controls" "Gives the keyboard to the controls, then to the map, the 3D view and their lights: Tab goes on, Escape comes back" ["F6"]
        TogglePanels "toggle_panels" "Hide panels" "Hides all panels, and brings them back" ["Tab"]
        ToggleHistory "toggle_history" "History" "Shows the list of changes" ["Ctrl+H"]
        ToggleTheme "toggle_theme" "Light or dark" "Changes between the light and the dark theme" ["F10"]
        FullScreen "full_screen" "Full screen" "Fills the screen with the window" ["F11"]
        ScaleUp "scale_up" "Larger interface" "Makes text and controls larger" ["Ctrl+Shift+Equals", "Ctrl+Shift+Plus"]
        ScaleDown "scale_down" "Smaller interface" "Makes text and controls smaller" ["Ctrl+Shift+Minus"]
    }
}

impl Action {
    /// What it is listed under.
    pub fn group(self) -> Group {
        self.entry().group
    }

    /// Its word in the keymap file.
    pub fn word(self) -> &'static str {
        self.entry().word
    }

    /// Its name in menus and on buttons; an ellipsis says that a dialog follows.
    pub fn name(self) -> &'static str {
        self.entry().name
    }

    /// What it does, as a clause without a full stop.
    pub fn doc(self) -> &'static str {
        self.entry().doc
    }

    /// The keys that reach it where no keymap file says otherwise.
    pub fn default_keys(self) -> &'static [&'static str] {
        self.entry().keys
    }
}

impl FromStr for Action {
    type Err = Error;

    /// The action of a word of the keymap file.
    fn from_str(word: &str) -> Result<Self> {
        let found = Self::ALL.iter().copied().find(|a| a.word() == word);
        found.ok_or_else(|| {
            let error =
                Error::invalid("action", format!("`{word}`"), "allowed: a word of the list");
            match nearest_word(word, Self::ALL.iter().map(|a| a.word())) {
                Some(near) => error.with_hint(format!("Did you mean `{near}`?")),
                None => error.with_hint("The list of shortcuts (F1) shows every word"),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn words_and_names_are_unique_and_say_what_the_interface_says() {
        let words: BTreeSet<_> = Action::ALL.iter().map(|a| a.word()).collect();
        let names: BTreeSet<_> = Action::ALL.iter().map(|a| a.name()).collect();
        assert_eq!(words.len(), Action::ALL.len());
        assert_eq!(names.len(), Action::ALL.len());
        for action in Action::ALL {
            assert_eq!(action.word().parse::<Action>().unwrap(), *action);
            assert!(!action.doc().ends_with('.'), "{action:?}");
            assert!(!action.default_keys().is_empty(), "{action:?}");
        }
    }

    #[test]
    fn an_unknown_word_is_told_with_the_nearest() {
        let e = "undoo".parse::<Action>().unwrap_err().to_string();
        assert!(e.contains("Did you mean `undo`"), "{e}");
    }
}
