//! The page of a run: it tells what the tables say, opens without a network, and takes no name for markup.

use std::collections::BTreeSet;
use std::path::PathBuf;

use arrow::array::{Array, AsArray};
use roxmltree::{Document, Node, ParsingOptions};

use super::cell::{Cell, files, undisturbed};

/// The path of the only page in the cell's lake of which the path holds this text.
fn page_of(cell: &Cell, part: &str) -> PathBuf {
    let pages = files(&cell.path("lake/report")).into_keys();
    let pages: Vec<String> = pages.filter(|path| path.contains(part)).collect();
    assert_eq!(pages.len(), 1, "{pages:?}");
    cell.path("lake/report").join(&pages[0])
}

fn text_of(cell: &Cell, part: &str) -> String {
    std::fs::read_to_string(page_of(cell, part)).expect("readable")
}

fn parsed(page: &str) -> Document<'_> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    Document::parse_with_options(page, options).unwrap_or_else(|error| panic!("{error}"))
}

/// The values that the page's figures carry.
fn values(document: &Document<'_>) -> BTreeSet<String> {
    let figures = document.descendants().filter(|node| node.has_tag_name("data"));
    figures.filter_map(|node| node.attribute("value").map(str::to_owned)).collect()
}

#[test]
fn the_page_tells_what_the_tables_say() {
    let cell = undisturbed();
    let page = text_of(cell, "kr210-demo/mon/");
    let document = parsed(&page);
    let values = values(&document);
    let accuracy = cell.table("accuracy", "mon");
    let steps = cell.table("grid_steps", "mon");
    let figures =
        [(&accuracy, "value"), (&steps, "mean_mm"), (&steps, "p95_mm"), (&steps, "bound_mm")];
    let mut compared = 0;
    for (table, column) in figures {
        // Mean + 3 σ is the literature's figure and the squared distance an auditor's: they stand in the table alone.
        let is_apart = |row: usize| {
            let of = ["mean_plus_3sd", "mean_mahalanobis_squared"];
            column == "value" && of.contains(&table.text("name").value(row))
        };
        for row in (0..table.rows()).filter(|row| !is_apart(*row)) {
            let cell = table.f64(column);
            if cell.is_valid(row) {
                let value = cell.value(row).to_string();
                assert!(values.contains(&value), "{column}, row {row}: {value} is not on the page");
                compared += 1;
            }
        }
    }
    assert!(compared > 60, "{compared} figures compared");
    for part in [
        "Tolerance met",
        "held-out blocks of mon",
        "predicted",
        "kr210-demo · mon · 2023-11-14 22:13 UTC",
        "What to do now",
        "posegrid compensate lake/compensation/kr210-demo/mon/",
    ] {
        assert!(page.contains(part), "{part}");
    }
}

#[test]
fn the_run_names_its_page_and_keeps_its_digest() {
    let cell = undisturbed();
    let path = page_of(cell, "kr210-demo/tue/");
    let name = path.file_name().expect("a file").to_string_lossy().into_owned();
    let run = name.strip_suffix(".html").expect("a page").to_owned();
    cell.run(&[]).expect(0, &[&format!("report/kr210-demo/tue/{name}")]);
    let runs = cell.table("runs", "tue");
    assert_eq!(runs.text("run").value(0), run);
    let list = |column: &str| -> Vec<String> {
        let list = runs.list(column).value(0);
        list.as_string::<i32>().iter().flatten().map(str::to_owned).collect()
    };
    let place = list("table_names").iter().position(|file| file == "report/tue");
    let digest = &list("table_digests")[place.expect("the page is among the files of the run")];
    let bytes = std::fs::read(&path).expect("readable");
    assert_eq!(*digest, blake3::hash(&bytes).to_hex().to_string());
}

#[test]
fn the_page_needs_nothing_from_anywhere() {
    let page = text_of(undisturbed(), "kr210-demo/mon/");
    assert!(page.len() < 500_000, "{} bytes are much for a mail", page.len());
    let document = parsed(&page);
    let elements = || document.descendants().filter(Node::is_element);
    for name in ["script", "link", "img", "iframe", "object", "embed", "image", "use"] {
        assert!(!elements().any(|node| node.has_tag_name(name)), "<{name}>");
    }
    for attribute in elements().flat_map(|node| node.attributes()) {
        let (name, value) = (attribute.name(), attribute.value());
        let leads = value.starts_with('#') || value.starts_with("../../../pages/");
        let is_link = name == "href" && leads;
        assert!(
            is_link || !matches!(name, "href" | "src" | "srcset" | "action" | "data" | "poster"),
            "{name}={value}"
        );
        assert!(!name.starts_with("on") && !value.contains("http"), "{name}={value}");
    }
    assert!(!page.contains("url(") && !page.contains("@import"), "the style loads nothing");
    assert!(page.contains("@media print") && page.contains("prefers-color-scheme: dark"));
}

#[test]
fn every_chart_says_in_words_what_it_shows() {
    let page = text_of(undisturbed(), "kr210-demo/mon/");
    let document = parsed(&page);
    let charts: Vec<_> = document.descendants().filter(|node| node.has_tag_name("svg")).collect();
    // The colours and six panels of the work space, the colours and three panels of what is left, two of its errors, steps, two
    // semivariograms, six joints, two of parameters.
    assert_eq!(charts.len(), 24);
    let mut names = BTreeSet::new();
    // The legend of the colours stands over both.
    let charts = charts.into_iter().enumerate().filter(|(place, _)| *place != 7);
    for (_, chart) in charts {
        let text = |name: &str| {
            chart.children().find(|node| node.has_tag_name(name)).and_then(|node| node.text())
        };
        assert_eq!(chart.attribute("role"), Some("img"));
        assert!(text("desc").is_some_and(|desc| desc.len() > 20), "{:?}", text("title"));
        assert!(names.insert(text("title").expect("a title")), "{:?} twice", text("title"));
    }
}

#[test]
fn names_from_logs_and_settings_are_text() {
    let session = "<script>alert('1')<\"&\u{202e}x";
    let robot = "name = \"</title><b onclick=\\\"x\\\">\\n&amp;\"";
    let cell = Cell::new().with("name = \"kr210-demo\"", robot).with_quickstart(session);
    cell.run(&[]).expect(0, &["1 of 1 within 0.5 mm"]);
    let page = text_of(&cell, "");
    let document = parsed(&page);
    let has = |name: &str| document.descendants().any(|node| node.has_tag_name(name));
    assert!(!has("script") && !has("b"), "a name became markup");
    assert!(
        page.contains("&lt;script&gt;alert('1')&lt;&quot;&amp;\\u{202e}x"),
        "shown as it is, the mark written out"
    );
    assert!(!page.contains('\u{202e}'));
}
