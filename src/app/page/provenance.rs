use maud::{Markup, html};

use super::content::Content;
use super::words;
use crate::manifest::{VERSION, Work, Written};

pub(super) fn section(content: &Content) -> Markup {
    html! {
        dl.list {
            div { dt { "Run" } dd { code { (content.key.run) } } }
            div { dt { "Robot" } dd { (content.key.robot) } }
            div { dt { "Session" } dd { (content.key.session) } }
            div { dt { "Pipeline file" } dd { (content.work.pipeline) } }
            div { dt { "posegrid" } dd { (VERSION) } }
        }
        p.note { "The machine that computed it, and the run that this one replaces, are in " code { "runs" } "." }
        (made_from(&content.work, &content.written))
    }
}

/// The files that were read and written, and the settings.
pub(super) fn made_from(work: &Work, written: &[Written]) -> Markup {
    let inputs = work.inputs.iter().map(|own| (own.name.clone(), own.bytes, &own.digest));
    let tables = written.iter().map(|own| (own.name(), own.rows, &own.digest));
    html! {
        h3 { "Inputs" }
        (files(inputs, "Bytes"))
        h3 { "Tables" }
        (files(tables, "Rows"))
        details { summary { "Every setting, defaults filled in" } pre { (settings(&work.settings)) } }
    }
}

fn files<'f>(files: impl Iterator<Item = (String, u64, &'f String)>, size: &str) -> Markup {
    let head = html! { th { "File" } th { (size) } th.word { "BLAKE3" } };
    let body = html! {
        @for (name, number, digest) in files {
            tr { th.word scope="row" { (name) } td { (words::whole(number)) } td.word.digest { code { (digest) } } }
        }
    };
    super::table(&head, &body)
}

/// The settings over several lines; unchanged where they are no JSON.
fn settings(text: &str) -> String {
    let value: Option<serde_json::Value> = serde_json::from_str(text).ok();
    let pretty = value.and_then(|value| serde_json::to_string_pretty(&value).ok());
    pretty.unwrap_or_else(|| text.to_owned())
}

pub(super) fn reading_section(content: &Content) -> Markup {
    let query = format!(
        "SELECT model, angles, name, value, unit, n, verdict\nFROM read_parquet('lake/accuracy/**/*.parquet')\nWHERE run = '{}';",
        content.key.run
    );
    html! {
        p {
            "Everything on this page is in the run's tables, Parquet files " code { "TABLE/ROBOT/SESSION/RUN.parquet" } " next to it; "
            "rows of this run have its name in the column " code { "run" } ". With DuckDB, for example:"
        }
        pre { (query) }
        p {
            "Figures of stations that took part in a fit are too small; only held-out ones carry a verdict. A bound is distribution-free: the "
            "share asked for of all errors lies below it, with the confidence asked for. Visits of one pose count once, with the worst of "
            "them; the number of visits is next to n. Poses of one block are not independent of "
            "each other, so the number of blocks is given too. " code { "posegrid schema TABLE" } " describes each column."
        }
    }
}
