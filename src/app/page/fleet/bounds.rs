use maud::{Markup, html};

use super::content::{Content, how_many};
use crate::io::tables::words::TableVerdict;
use crate::page::words::verdict;
use crate::report::chart::{Axis, Chart, Limit, Marks, Series};

pub(super) fn section(content: &Content) -> Option<Markup> {
    let newest = content.measured().map(|(_, newest)| newest);
    let mut ratios: Vec<(f64, TableVerdict)> =
        newest.filter_map(|newest| Some((newest.ratio()?, newest.verdict))).collect();
    if ratios.len() < 2 {
        return None;
    }
    ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
    let of = |own: TableVerdict| {
        let points = ratios.iter().enumerate().filter(|(_, (_, verdict))| *verdict == own);
        let points: Vec<[f64; 2]> =
            points.map(|(place, (ratio, _))| [place as f64 + 1.0, *ratio]).collect();
        (!points.is_empty()).then(|| Series::new(verdict(own), vec![Marks::Points(points)]))
    };
    let verdicts = [TableVerdict::Met, TableVerdict::NotMet, TableVerdict::NotShown];
    let chart = Chart {
        title: "Bound over tolerance of each robot".to_owned(),
        description:
            "The bound of each robot's newest session divided by its tolerance, the smallest first."
                .to_owned(),
        x: Axis::of_whole_numbers("robot by rank", ""),
        y: Axis::new("bound over tolerance", "").including(&[0.0, 1.1]),
        series: verdicts.into_iter().filter_map(of).collect(),
        limits: vec![Limit { name: "tolerance".to_owned(), value: 1.0 }],
    };
    Some(html! {
        figure {
            (chart.svg())
            figcaption { "Newest sessions of " (how_many(ratios.len())) ", the smallest bound over its tolerance first." }
        }
    })
}
