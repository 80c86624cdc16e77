use maud::{Markup, html};

use super::content::Content;
use crate::manifest::VERSION;
use crate::page::provenance::made_from;

pub(super) fn section(content: &Content) -> Markup {
    html! {
        dl.list {
            div { dt { "Plan" } dd { code { (content.plan) } } }
            div { dt { "Robot" } dd { (content.robot) } }
            div { dt { "Pipeline file" } dd { (content.work.pipeline) } }
            div { dt { "posegrid" } dd { (VERSION) } }
        }
        p.note {
            "The plan's id follows from inputs, settings and version. Name it in " code { "[report] plan" } ", or in the log's metadata record "
            code { "session" } " as " code { "plan" } ", and the session's report states whether the promise was kept."
        }
        (made_from(&content.work, &content.written))
    }
}

pub(super) fn reading_section(content: &Content) -> Markup {
    let query = format!(
        "SELECT study, value, design, source, interpolation, step_mm, poses, mean_mm, p95_mm, bound_mm, meet, robots\n\
         FROM read_parquet('lake/plan_figures/**/*.parquet')\nWHERE run = '{}';",
        content.plan
    );
    html! {
        p {
            "Every figure on this page is in the plan's tables, Parquet files " code { "TABLE/ROBOT/plan/RUN.parquet" } " next to it: "
            code { "sampling_plan" } " is the session, pose by pose, " code { "plan_figures" } " the figures that it follows from. With DuckDB, for example:"
        }
        pre { (query) }
        p {
            "Errors are of fresh poses, relative to the simulated truth without the tracker's noise. A robot meets the tolerance where the "
            "distribution-free bound on its own errors does; " em { "at least" } " is the share of all robots that is shown to, by Clopper and "
            "Pearson. " code { "posegrid schema TABLE" } " describes each column."
        }
    }
}
