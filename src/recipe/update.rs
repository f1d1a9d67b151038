//! A changed recipe back into its text: only what differs between the recipe before and after is touched, so comments,
//! order and defaults left unwritten stay as the user has them.

use super::Recipe;
use super::locate::name_of;
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, TableLike, Value};

/// The text of a recipe that has none yet.
pub(super) fn document_of(recipe: &Recipe) -> DocumentMut {
    let mut document = DocumentMut::new();
    for (key, item) in plain(recipe).iter() {
        document.insert(key, tidy(item));
    }
    document
}

/// Makes a text that says `before` say `after`.
pub(super) fn update(text: &mut Table, before: &Recipe, after: &Recipe) {
    let (mut before, mut after) = (plain(before), plain(after));
    let old_layers = before.remove("layers");
    let new_layers = after.remove("layers");
    apply(text, &before, &after);
    update_layers(text, tables(old_layers), tables(new_layers));
}

fn plain(recipe: &Recipe) -> Table {
    toml_edit::ser::to_document(recipe)
        .expect("a checked recipe is plain data")
        .into_table()
}

/// The tables of a list of layers as the serialiser writes it.
fn tables(item: Option<Item>) -> Vec<Table> {
    match item {
        Some(Item::ArrayOfTables(list)) => list.into_iter().collect(),
        Some(Item::Value(Value::Array(list))) => list
            .into_iter()
            .filter_map(|value| match value {
                Value::InlineTable(table) => Some(table.into_table()),
                _ => None,
            })
            .collect(),
        _ => Vec::new(),
    }
}

/// Applies what differs between two tables to a third.
fn apply(text: &mut dyn TableLike, before: &dyn TableLike, after: &dyn TableLike) {
    for (key, _) in before.iter().filter(|(key, _)| !after.contains_key(key)) {
        text.remove(key);
    }
    for (key, new) in after.iter() {
        let old = before.get(key);
        if old.is_some_and(|old| old.to_string() == new.to_string()) {
            continue;
        }
        if let Some(list) = text.get_mut(key).and_then(Item::as_array_of_tables_mut)
            && apply_each(list, tables(old.cloned()), tables(Some(new.clone())))
        {
            continue;
        }
        match (old.and_then(Item::as_table_like), new.as_table_like()) {
            (Some(old), Some(new)) => {
                let there = text.entry(key).or_insert_with(|| Item::Table(Table::new()));
                if let Some(there) = there.as_table_like_mut() {
                    apply(there, old, new);
                }
            }
            _ => set(text, key, new),
        }
    }
}

/// Applies what differs between two lists of tables to a third, table by table, from the first; what is new is put behind,
/// what is gone is taken off the end. Lists that are not all of tables are left alone.
fn apply_each(text: &mut ArrayOfTables, before: Vec<Table>, after: Vec<Table>) -> bool {
    if text.len() != before.len() || after.is_empty() {
        return false;
    }
    let mut list = ArrayOfTables::new();
    for (i, new) in after.iter().enumerate() {
        let table = match (text.get(i), before.get(i)) {
            (Some(table), Some(old)) => {
                let mut table = table.clone();
                apply(&mut table, old, new);
                table
            }
            _ => tidy_table(new),
        };
        list.push(unplaced(table));
    }
    *text = list;
    true
}

/// Sets a key, keeping the spaces and the comment around a value that was there.
fn set(text: &mut dyn TableLike, key: &str, new: &Item) {
    let mut item = tidy(new);
    if let (Some(Item::Value(old)), Item::Value(value)) = (text.get(key), &mut item) {
        *value.decor_mut() = old.decor().clone();
    }
    match text.get_mut(key) {
        Some(there) => *there = item,
        None => {
            text.insert(key, item);
        }
    }
}

/// Layers are known by their names: one that moved takes its text along.
fn update_layers(text: &mut Table, before: Vec<Table>, after: Vec<Table>) {
    let mut written: Vec<Table> = match text.get("layers").cloned() {
        Some(item) => tables(Some(item)),
        None => Vec::new(),
    };
    let same = before.len() == after.len()
        && before
            .iter()
            .zip(&after)
            .all(|(b, a)| b.to_string() == a.to_string());
    if same {
        return;
    }
    let mut list = ArrayOfTables::new();
    for new in after {
        let name = name_of(&new);
        let old = before.iter().find(|t| name_of(t) == name);
        let place = written.iter().position(|t| name_of(t) == name);
        let table = match (old, place) {
            (Some(old), Some(place)) => {
                let mut table = written.remove(place);
                apply(&mut table, old, &new);
                table
            }
            _ => tidy_table(&new),
        };
        list.push(unplaced(table));
    }
    text.insert("layers", Item::ArrayOfTables(list));
}

/// A table that is written where it stands in its list, not where it was read.
fn unplaced(mut table: Table) -> Table {
    table.set_position(None);
    for (_, item) in table.iter_mut() {
        match item {
            Item::Table(inner) => *inner = unplaced(std::mem::take(inner)),
            Item::ArrayOfTables(list) => {
                *list = std::mem::take(list).into_iter().map(unplaced).collect();
            }
            _ => {}
        }
    }
    table
}

/// What the serialiser writes, as a person would: tables with headers, and f32 numbers without their tail.
fn tidy(item: &Item) -> Item {
    match item {
        Item::Value(Value::InlineTable(t)) => Item::Table(tidy_table(&t.clone().into_table())),
        Item::Table(t) => Item::Table(tidy_table(t)),
        Item::ArrayOfTables(list) => Item::ArrayOfTables(list.iter().map(tidy_table).collect()),
        Item::Value(Value::Array(list))
            if !list.is_empty() && list.iter().all(Value::is_inline_table) =>
        {
            tidy_list(item)
        }
        Item::Value(value) => Item::Value(tidy_value(value)),
        Item::None => Item::None,
    }
}

fn tidy_list(item: &Item) -> Item {
    let tables = tables(Some(item.clone()));
    Item::ArrayOfTables(tables.iter().map(tidy_table).collect())
}

fn tidy_table(table: &Table) -> Table {
    table.iter().map(|(key, item)| (key, tidy(item))).collect()
}

fn tidy_value(value: &Value) -> Value {
    match value {
        Value::Float(f) => Value::from(shortest(*f.value())),
        Value::Array(list) => Value::Array(list.iter().map(tidy_value).collect()),
        other => other.clone(),
    }
}

/// The number with the fewest digits that is the same f32.
fn shortest(number: f64) -> f64 {
    let narrow = number as f32;
    if f64::from(narrow) != number {
        return number;
    }
    narrow.to_string().parse().unwrap_or(number)
}

#[cfg(test)]
mod tests {
    use super::super::{Layer, RecipeFile, Source};
    use crate::pattern::{Constant, Pattern};

    const TEXT: &str = "# what it is for\nversion = 1\nsize = 64 # small\n\n[material] # measured\ndiffuse = [0.1, 0.1, 0.1]\n\n# the coat\n[[layers]]\nname = \"coat\"\nopacity = 0.50 # half\n[layers.constant]\nalpha_x = 0.2 # keep\n\n# the rest\n[[layers]]\nname = \"rest\"\n[layers.constant]\nangle = 10.0\n";

    fn file() -> RecipeFile {
        RecipeFile::parse(TEXT, "t.toml", None).unwrap()
    }

    #[test]
    fn an_unchanged_recipe_leaves_the_text_alone() {
        let mut file = file();
        file.update(file.recipe().clone()).unwrap();
        assert_eq!(file.to_toml(), TEXT);
    }

    #[test]
    fn a_change_touches_its_own_key_only() {
        let mut file = file();
        let mut recipe = file.recipe().clone();
        recipe.layers[0].opacity = 0.7;
        recipe.adjust.turn = 12.5;
        recipe.seed = 3;
        file.update(recipe.clone()).unwrap();
        let text = file.to_toml();
        assert!(text.contains("opacity = 0.7 # half\n"), "{text}");
        assert!(text.contains("[adjust]\nturn = 12.5\n"), "{text}");
        assert!(text.contains("seed = 3"), "{text}");
        for line in TEXT.lines().filter(|l| !l.starts_with("opacity")) {
            assert!(text.contains(line), "`{line}` in\n{text}");
        }
        let back = RecipeFile::parse(&text, "t.toml", None).unwrap();
        assert_eq!(back.recipe(), &recipe);
    }

    #[test]
    fn layers_take_their_comments_along() {
        let mut file = file();
        let mut recipe = file.recipe().clone();
        recipe.layers.swap(0, 1);
        let mut top = Layer::new(Source::Pattern(Pattern::Constant(Constant::default())));
        top.name = "top".to_owned();
        recipe.layers.push(top);
        file.update(recipe.clone()).unwrap();
        let text = file.to_toml();
        let place = |s: &str| text.find(s).unwrap_or_else(|| panic!("`{s}` in\n{text}"));
        assert!(place("# the rest") < place("# the coat") && place("# half") < place("\"top\""));
        assert!(place("alpha_x = 0.2 # keep") > place("\"coat\""));
        let back = RecipeFile::parse(&text, "t.toml", None).unwrap();
        assert_eq!(back.recipe(), &recipe);
        recipe.layers.remove(1);
        file.update(recipe.clone()).unwrap();
        assert!(!file.to_toml().contains("coat"));
        let back = RecipeFile::parse(&file.to_toml(), "t.toml", None).unwrap();
        assert_eq!(back.recipe(), &recipe);
    }

    #[test]
    fn lists_of_tables_below_a_layer_keep_their_comments_and_places() {
        let text = "version = 1\n[[layers]]\nname = \"a\"\n[layers.guides]\ngrid = 64 # fine\n\
            # the dial\n[[layers.guides.guide]]\nshape.ellipse.radii = [0.3, 0.3]\nfalloff = 0.1 # wide\n\
            # the hand\n[[layers.guides.guide]]\nshape.line.points = [[0, 0], [1, 1]]\n\
            # on top\n[[layers]]\nname = \"b\"\n[layers.constant]\n";
        let mut file = RecipeFile::parse(text, "t.toml", None).unwrap();
        let mut recipe = file.recipe().clone();
        let Source::Guides(guides) = &mut recipe.layers[0].source else {
            panic!("guides")
        };
        guides.guide[0].falloff = 0.2;
        guides.guide[1].center = Some([0.25, 0.5]);
        guides.guide.push(guides.guide[0].clone());
        recipe.layers.swap(0, 1);
        file.update(recipe.clone()).unwrap();
        let text = file.to_toml();
        for part in [
            "0.2 # wide",
            "# fine",
            "# the dial",
            "# the hand",
            "# on top",
            "[0.25, 0.5]",
        ] {
            assert!(text.contains(part), "`{part}` in\n{text}");
        }
        let place = |s: &str| text.find(s).unwrap();
        assert!(
            place("# on top") < place("# the dial") && place("# the dial") < place("# the hand")
        );
        let back = RecipeFile::parse(&text, "t.toml", None).unwrap();
        assert_eq!(back.recipe(), &recipe);
        let Source::Guides(guides) = &mut recipe.layers[1].source else {
            panic!("guides")
        };
        guides.guide.clear();
        file.update(recipe.clone()).unwrap();
        let back = RecipeFile::parse(&file.to_toml(), "t.toml", None).unwrap();
        assert_eq!(back.recipe(), &recipe);
    }

    #[test]
    fn a_recipe_without_text_gets_one() {
        let recipe = file().recipe().clone();
        let new = RecipeFile::new(recipe.clone(), "new.toml").unwrap();
        let text = new.to_toml();
        assert!(
            text.contains("[[layers]]") && text.contains("alpha_x = 0.2\n"),
            "{text}"
        );
        let back = RecipeFile::parse(&text, "new.toml", None).unwrap();
        assert_eq!(back.recipe(), &recipe);
    }
}
