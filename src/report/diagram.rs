//! A system as a picture: boxes for instances, layered from left to right, and arrows for what they give each other.

use super::frame::{CHARACTER, TEXT};
use super::html::{Html, html};
use super::svg::{FONTS, at};
use dagre::graph::{Edge, Graph, GraphOptions};
use dagre::layout::types::LabelPos;
use dagre::{EdgeLabel, LayoutOptions, NodeLabel, Point, RankDir, layout};
use std::fmt::Write;

/// Lines of an arrow's label.
const SHOWN: usize = 4;
/// Height of a line of text [points].
const LINE: f64 = 1.25 * TEXT;
/// Space around boxes and text [points].
const SPACE: f64 = 6.0;

/// An instance: lines of text in a box.
pub struct Block {
    /// Its name, and what it is.
    pub lines: [String; 2],
}

/// What one instance gives another: numbers of both, and the names of the signals.
pub struct Arrow {
    /// Who gives.
    pub from: usize,
    /// Who takes.
    pub to: usize,
    /// One line for each wire.
    pub lines: Vec<String>,
}

fn width(lines: &[String]) -> f64 {
    let longest = lines.iter().map(|line| line.chars().count()).max();
    CHARACTER * TEXT * longest.unwrap_or(0) as f64
}

/// The picture as an SVG document.
pub fn to_svg(title: &str, blocks: &[Block], arrows: &[Arrow]) -> String {
    let mut graph: Graph<NodeLabel, EdgeLabel> = Graph::with_options(GraphOptions {
        directed: true,
        // Two instances may give each other values.
        multigraph: true,
        compound: false,
    });
    for (k, block) in blocks.iter().enumerate() {
        let label = NodeLabel {
            width: width(&block.lines) + 2.0 * SPACE,
            height: 2.0 * LINE + 2.0 * SPACE,
            ..NodeLabel::default()
        };
        graph.set_node(k.to_string(), Some(label));
    }
    let labels: Vec<Vec<String>> = arrows.iter().map(label).collect();
    for (k, (arrow, label)) in arrows.iter().zip(&labels).enumerate() {
        let own = EdgeLabel {
            width: width(label) + SPACE,
            height: LINE * label.len() as f64 + SPACE,
            labelpos: LabelPos::Center,
            ..EdgeLabel::default()
        };
        let [from, to, name] = [arrow.from, arrow.to, k].map(|own| own.to_string());
        graph.set_edge(from, to, Some(own), Some(&name));
    }
    let options = LayoutOptions {
        rankdir: RankDir::LR,
        nodesep: 18.0,
        ranksep: 24.0,
        marginx: SPACE,
        marginy: SPACE,
        ..LayoutOptions::default()
    };
    layout(&mut graph, Some(options));
    drawn(title, &graph, blocks, &labels, arrows)
}

/// The names of an arrow's wires, the first few.
fn label(arrow: &Arrow) -> Vec<String> {
    let mut lines = arrow.lines.clone();
    if lines.len() > SHOWN {
        let more = lines.len() - (SHOWN - 1);
        lines.truncate(SHOWN - 1);
        lines.push(format!("and {more} more"));
    }
    lines
}

fn drawn(
    title: &str,
    graph: &Graph<NodeLabel, EdgeLabel>,
    blocks: &[Block],
    labels: &[Vec<String>],
    arrows: &[Arrow],
) -> String {
    let places: Vec<&NodeLabel> = (0..blocks.len())
        .filter_map(|k| graph.node(&k.to_string()))
        .collect();
    let edges: Vec<&EdgeLabel> = (arrows.iter().enumerate())
        .filter_map(|(k, own)| {
            let [from, to, name] = [own.from, own.to, k].map(|own| own.to_string());
            graph.edge_by_obj(&Edge::with_name(from, to, name))
        })
        .collect();
    let ends = places.iter().map(|own| {
        let middle = [own.x.unwrap_or(0.0), own.y.unwrap_or(0.0)];
        [middle[0] + own.width / 2.0, middle[1] + own.height / 2.0]
    });
    let bends = edges.iter().flat_map(|own| {
        let label = [
            own.x.unwrap_or(0.0) + own.width / 2.0,
            own.y.unwrap_or(0.0) + own.height / 2.0,
        ];
        own.points
            .iter()
            .map(|point| [point.x, point.y])
            .chain([label])
    });
    let all: Vec<[f64; 2]> = ends.chain(bends).collect();
    let size = [0, 1].map(|k| all.iter().map(|end| end[k]).fold(0.0, f64::max) + SPACE);
    let svg = html! {
        svg xmlns="http://www.w3.org/2000/svg" width=(format_args!("{:.2}pt", size[0])) height=(format_args!("{:.2}pt", size[1]))
            viewBox=(format_args!("0 0 {:.2} {:.2}", size[0], size[1]))
            font-family=(FONTS) font-size=(TEXT) text-anchor="middle" {
            title { (title) }
            defs { marker id="head" markerWidth="6" markerHeight="6" refX="5.5" refY="3" orient="auto" {
                path d="M0,0 L6,3 L0,6 z" fill="#444444" {}
            } }
            rect width="100%" height="100%" fill="#ffffff" {}
            @for edge in &edges {
                path d=(path(&edge.points)) fill="none" stroke="#444444" stroke-width="0.8" marker-end="url(#head)" {}
            }
            @for (edge, label) in edges.iter().zip(labels) { (label_of(edge, label)) "\n" }
            @for (place, block) in places.iter().zip(blocks) { (block_at(place, block)) "\n" }
        }
        "\n"
    };
    svg.into_string()
}

/// A line through points, rounded at its bends.
fn path(points: &[Point]) -> String {
    let mut path = String::new();
    let Some(first) = points.first() else {
        return path;
    };
    let _ = write!(path, "M{:.2},{:.2}", first.x, first.y);
    for pair in points[1..].windows(2) {
        let [a, b] = pair else { continue };
        let (x, y) = (0.5 * (a.x + b.x), 0.5 * (a.y + b.y));
        let _ = write!(path, " Q{:.2},{:.2} {x:.2},{y:.2}", a.x, a.y);
    }
    if let Some(last) = points.last() {
        let _ = write!(path, " L{:.2},{:.2}", last.x, last.y);
    }
    path
}

fn label_of(edge: &EdgeLabel, label: &[String]) -> Html {
    let (x, y) = (edge.x.unwrap_or(0.0), edge.y.unwrap_or(0.0));
    let top = y - LINE * (label.len() as f64 - 1.0) / 2.0 + 0.35 * TEXT;
    let [wide, high] = [edge.width - SPACE + 2.0, edge.height - SPACE];
    html! {
        rect x=(at(x - wide / 2.0)) y=(at(y - high / 2.0)) width=(at(wide)) height=(at(high)) fill="#ffffff" {}
        @for (k, line) in label.iter().enumerate() {
            text x=(at(x)) y=(at(top + LINE * k as f64)) fill="#444444" { (line) }
        }
    }
}

fn block_at(place: &NodeLabel, block: &Block) -> Html {
    let (x, y) = (place.x.unwrap_or(0.0), place.y.unwrap_or(0.0));
    let [name, what] = &block.lines;
    html! {
        rect x=(at(x - place.width / 2.0)) y=(at(y - place.height / 2.0)) width=(at(place.width)) height=(at(place.height))
            rx="2" fill="#f2f5fa" stroke="#1f4e79" {}
        text x=(at(x)) y=(at(y - 0.15 * LINE)) font-weight="bold" { (name) }
        text x=(at(x)) y=(at(y + 0.85 * LINE)) fill="#444444" { (what) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(name: &str) -> Block {
        let lines = [name.to_owned(), "x.fmu".to_owned()];
        Block { lines }
    }

    /// A loop of two, an instance that feeds itself, one that nothing feeds; names that are markup; many wires.
    #[test]
    fn all_instances_and_arrows_are_drawn() {
        let blocks = ["pilot", "a<b>&\"c\"", "alone"].map(block);
        let arrow = |from, to, count| Arrow {
            from,
            to,
            lines: (0..count).map(|k| format!("y{k} → u{k}")).collect(),
        };
        let arrows = [arrow(0, 1, 1), arrow(1, 0, 7), arrow(1, 1, 1)];
        let svg = to_svg("s.toml", &blocks, &arrows);
        let document = roxmltree::Document::parse(&svg).unwrap();
        let count = |name, attribute| {
            let all = document.descendants();
            all.filter(|own| {
                own.has_tag_name(("http://www.w3.org/2000/svg", name))
                    && own.has_attribute(attribute)
            })
            .count()
        };
        assert_eq!(count("path", "marker-end"), 3, "{svg}");
        assert_eq!(count("rect", "stroke"), 3, "{svg}");
        let texts = document.descendants().filter_map(|own| own.text());
        let texts: Vec<&str> = texts.filter(|own| !own.trim().is_empty()).collect();
        for wanted in ["pilot", "a<b>&\"c\"", "alone", "y0 → u0", "and 4 more"] {
            assert!(texts.contains(&wanted), "{wanted}: {texts:?}");
        }
        assert!(!svg.contains("NaN"), "{svg}");
    }

    #[test]
    fn a_system_without_arrows_is_drawn() {
        assert!(to_svg("s", &[block("a")], &[]).contains("x.fmu"));
    }
}
