//! Cost against error: one or more panels over each other that share their points, each with its Pareto front, every point
//! labelled, and a table beside them that gives each point's name and numbers.

use super::labels::{Obstacles, Placed, Rect, Wanted, place};
use super::svg::{Anchor, Axis, Frame, INK, PALE, Svg, number, text_width};

/// Points up to which all are labelled with their names; of more, those on the front are, and the others with their numbers.
const FEW: usize = 12;
const LABEL: f64 = 11.0;
const PANEL: (f64, f64) = (640.0, 400.0);
const LEFT: f64 = 78.0;
const TOP: f64 = 74.0;
/// From one panel's lower edge to the next one's upper edge.
const BETWEEN: f64 = 78.0;
const ROW: f64 = 15.0;
const MARKER: f64 = 4.2;

/// A name's leader line is no longer than this.
const FAR: f64 = 32.0;

/// A method.
#[derive(Clone, Debug)]
pub(super) struct Mark {
    pub(super) name: String,
    /// Which of the chart's groups it belongs to.
    pub(super) group: usize,
    /// What it costs.
    pub(super) x: f64,
    /// Its error, for each panel.
    pub(super) y: Vec<f64>,
}

/// A chart.
#[derive(Clone, Debug)]
pub(super) struct Scatter {
    pub(super) title: String,
    /// What was measured, in a line.
    pub(super) subtitle: String,
    /// What costs are, and the word for them over the table.
    pub(super) x: (&'static str, &'static str),
    /// What errors are, for each panel, and the words over the table.
    pub(super) y: Vec<(&'static str, &'static str)>,
    /// Each has a shape of its own.
    pub(super) groups: Vec<String>,
    pub(super) marks: Vec<Mark>,
}

/// The indices of the points that no other beats in both numbers, from the cheapest on.
pub(super) fn front(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| {
        let ((ax, ay), (bx, by)) = (points[a], points[b]);
        ax.total_cmp(&bx).then(ay.total_cmp(&by))
    });
    let mut best = f64::INFINITY;
    order.retain(|&i| {
        let better = points[i].1 < best;
        best = best.min(points[i].1);
        better
    });
    order
}

impl Scatter {
    /// The chart as an SVG file's text.
    pub(super) fn svg(&self) -> String {
        let panels = self.y.len() as f64;
        let names = self.marks.iter().map(|m| text_width(&m.name, LABEL));
        let columns = 70.0 * (1 + self.y.len()) as f64;
        let table = 58.0 + names.fold(60.0, f64::max) + columns;
        let width = LEFT + PANEL.0 + 30.0 + table + 20.0;
        let rows = TOP + ROW * (self.marks.len() + self.groups.len() + 4) as f64;
        let height = (TOP + panels * PANEL.1 + (panels - 1.0) * BETWEEN + 62.0).max(rows + 20.0);
        let mut svg = Svg::new(width, height, &self.title);
        svg.bold((20.0, 28.0), 17.0, Anchor::Start, INK, &self.title);
        svg.text((20.0, 48.0), 12.0, Anchor::Start, PALE, &self.subtitle);
        let x = Axis::log(self.x.0, self.marks.iter().map(|m| m.x));
        for (panel, (title, _)) in self.y.iter().enumerate() {
            let frame = Frame {
                corner: (LEFT, TOP + panel as f64 * (PANEL.1 + BETWEEN)),
                size: PANEL,
                x: x.clone(),
                y: Axis::log(title, self.marks.iter().map(|m| m.y[panel])),
            };
            frame.draw(&mut svg);
            self.panel(&mut svg, &frame, panel);
        }
        self.table(&mut svg, LEFT + PANEL.0 + 30.0);
        svg.finish()
    }

    fn panel(&self, svg: &mut Svg, frame: &Frame, panel: usize) {
        let values: Vec<(f64, f64)> = self.marks.iter().map(|m| (m.x, m.y[panel])).collect();
        let points: Vec<(f64, f64)> = values.iter().map(|(x, y)| frame.at(*x, *y)).collect();
        let front = front(&values);
        let line = steps(&front.iter().map(|&i| points[i]).collect::<Vec<_>>());
        svg.polyline(&line, INK, 1.2, "6 3");
        let labels = self.labels(frame, &points, &front, &line);
        for (_, _, label) in &labels {
            if let Some((from, to)) = label.leader {
                svg.line(from, to, PALE, 0.7);
            }
        }
        for (i, mark) in self.marks.iter().enumerate() {
            marker(svg, points[i], mark.group, front.contains(&i));
        }
        for (i, text, label) in &labels {
            let ink = if front.contains(i) { INK } else { PALE };
            let at = (label.text.left, label.text.bottom - 2.6);
            svg.over(at, LABEL, ink, text);
        }
    }

    /// Every point's label with its place: names on the front and where points are few, else numbers. A name that would have to
    /// stand far from its point gives way to the number. Where there is no room at all the table still has it.
    fn labels(
        &self,
        frame: &Frame,
        points: &[(f64, f64)],
        front: &[usize],
        line: &[(f64, f64)],
    ) -> Vec<(usize, String, Placed)> {
        let (corner, size) = (frame.corner, frame.size);
        let around = Obstacles {
            area: Rect {
                left: corner.0 + 3.0,
                top: corner.1 + 3.0,
                right: corner.0 + size.0 - 3.0,
                bottom: corner.1 + size.1 - 3.0,
            },
            marker: MARKER,
            points,
            line,
        };
        // The front chooses its places first, then the others from left to right.
        let mut order = front.to_vec();
        let mut others: Vec<usize> = (0..points.len()).filter(|i| !front.contains(i)).collect();
        others.sort_by(|&a, &b| points[a].0.total_cmp(&points[b].0));
        order.extend(others);
        let is_named = |i: &usize| front.contains(i) || self.marks.len() <= FEW;
        let mut named: Vec<usize> = order.iter().copied().filter(is_named).collect();
        loop {
            let text = |i: usize| {
                if named.contains(&i) {
                    format!("{} {}", i + 1, self.marks[i].name)
                } else {
                    (i + 1).to_string()
                }
            };
            let wanted: Vec<Wanted> = order
                .iter()
                .map(|&i| Wanted {
                    at: points[i],
                    size: (text_width(&text(i), LABEL), LABEL + 1.0),
                })
                .collect();
            let placed = place(&wanted, around);
            let is_far = |label: &Option<Placed>| label.is_none_or(|l| l.reach() > FAR);
            let far = order.iter().zip(&placed).rev();
            let far = far.filter(|(i, label)| named.contains(i) && is_far(label));
            let Some((&worst, _)) = far.into_iter().next() else {
                let labels = order.iter().zip(placed);
                return labels
                    .filter_map(|(&i, label)| Some((i, text(i), label?)))
                    .collect();
            };
            named.retain(|&i| i != worst);
        }
    }

    fn table(&self, svg: &mut Svg, left: f64) {
        let widest = self.marks.iter().map(|m| text_width(&m.name, LABEL));
        let names = left + 38.0;
        let first = names + widest.fold(60.0, f64::max) + 62.0;
        let column = |c: usize| first + 70.0 * c as f64;
        let mut y = TOP + 4.0;
        svg.text(
            (names, y),
            LABEL,
            Anchor::Start,
            PALE,
            "dashed: the Pareto front, its points filled",
        );
        y += ROW;
        for (group, name) in self.groups.iter().enumerate() {
            marker(svg, (left + 28.0, y - 4.0), group, false);
            svg.text((names, y), LABEL, Anchor::Start, INK, name);
            y += ROW;
        }
        y += 0.7 * ROW;
        let heads = std::iter::once(self.x.1).chain(self.y.iter().map(|y| y.1));
        for (c, head) in heads.enumerate() {
            svg.text((column(c), y), LABEL, Anchor::End, PALE, head);
        }
        svg.line((left, y + 4.0), (column(self.y.len()), y + 4.0), PALE, 0.8);
        y += ROW + 2.0;
        for (i, mark) in self.marks.iter().enumerate() {
            svg.text(
                (left + 18.0, y),
                LABEL,
                Anchor::End,
                INK,
                &(i + 1).to_string(),
            );
            marker(svg, (left + 28.0, y - 4.0), mark.group, false);
            svg.text((names, y), LABEL, Anchor::Start, INK, &mark.name);
            for (c, value) in std::iter::once(&mark.x).chain(&mark.y).enumerate() {
                svg.text(
                    (column(c), y),
                    LABEL,
                    Anchor::End,
                    INK,
                    &three_digits(*value),
                );
            }
            y += ROW;
        }
    }
}

/// A number of a table.
pub(super) fn three_digits(v: f64) -> String {
    if v != 0.0 && v.abs() < 1e-3 {
        format!("{v:.1e}")
    } else {
        number(v)
    }
}

/// The front as steps: to the right of each of its points nothing worse is worth its time.
fn steps(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut line = Vec::new();
    for (i, p) in points.iter().enumerate() {
        if i > 0 {
            line.push((p.0, points[i - 1].1));
        }
        line.push(*p);
    }
    line
}

/// A group's shape: filled on the front, hollow elsewhere.
fn marker(svg: &mut Svg, (x, y): (f64, f64), group: usize, is_front: bool) {
    let fill = if is_front { INK } else { "white" };
    let r = MARKER;
    let polygon = |points: &[(f64, f64)]| -> Vec<(f64, f64)> {
        points.iter().map(|(a, b)| (x + a * r, y + b * r)).collect()
    };
    match group % 7 {
        0 => svg.circle((x, y), r, fill, INK),
        1 => svg.polygon(
            &polygon(&[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)]),
            fill,
            INK,
        ),
        2 => svg.polygon(&polygon(&[(0.0, -1.1), (1.1, 0.9), (-1.1, 0.9)]), fill, INK),
        3 => svg.polygon(
            &polygon(&[(0.0, -1.25), (1.25, 0.0), (0.0, 1.25), (-1.25, 0.0)]),
            fill,
            INK,
        ),
        4 => svg.polygon(
            &polygon(&[(0.0, 1.1), (1.1, -0.9), (-1.1, -0.9)]),
            fill,
            INK,
        ),
        5 => svg.polygon(
            &polygon(&[
                (-0.4, -1.1),
                (0.4, -1.1),
                (0.4, -0.4),
                (1.1, -0.4),
                (1.1, 0.4),
                (0.4, 0.4),
                (0.4, 1.1),
                (-0.4, 1.1),
                (-0.4, 0.4),
                (-1.1, 0.4),
                (-1.1, -0.4),
                (-0.4, -0.4),
            ]),
            fill,
            INK,
        ),
        _ => svg.polygon(
            &polygon(&[
                (-0.6, -1.1),
                (0.6, -1.1),
                (1.2, 0.0),
                (0.6, 1.1),
                (-0.6, 1.1),
                (-1.2, 0.0),
            ]),
            fill,
            INK,
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_is_what_nothing_beats() {
        let points = [
            (1.0, 9.0),
            (2.0, 3.0),
            (3.0, 4.0),
            (4.0, 1.0),
            (2.0, 5.0),
            (9.0, 1.0),
        ];
        assert_eq!(front(&points), [0, 1, 3]);
        assert_eq!(front(&[]), [0usize; 0]);
        assert_eq!(front(&[(1.0, 1.0), (1.0, 1.0)]).len(), 1);
    }

    #[test]
    fn every_point_has_a_label_and_a_line_in_the_table() {
        let marks = (0..30u32)
            .map(|i| Mark {
                name: format!("method <{i}>"),
                group: i as usize % 5,
                x: 0.5 + 0.001 * f64::from(i * 7 % 11),
                y: vec![1e-5 * f64::from(1 + i % 3), 0.0],
            })
            .collect();
        let chart = Scatter {
            title: "A chart".into(),
            subtitle: "of thirty points in one place".into(),
            x: ("ns", "ns"),
            y: vec![("largest error", "max"), ("mean error", "mean")],
            groups: (0..5).map(|g| format!("group {g}")).collect(),
            marks,
        };
        let text = chart.svg();
        assert!(text.contains("method &lt;7&gt;"));
        for i in 1..=30 {
            // Twice in the panels, once in the table, with or without a name.
            let alone = text.matches(&format!(">{i}</text>")).count();
            let named = text.matches(&format!(">{i} method")).count();
            assert!(alone + named >= 3, "{i}: {alone} {named}");
        }
    }
}
