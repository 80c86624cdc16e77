use std::collections::BTreeMap;

use crate::cli::messages::Printable;
use crate::pipeline::verify::{FilesOfLake, WithoutRow};

/// A line for each file that does not belong or is left over, and for each request that is missing or contradicts others; then the number of files of each owner.
pub(super) fn lines(account: &FilesOfLake, is_whole: bool) -> Vec<String> {
    let mut lines: Vec<String> = account.without_row.iter().map(without_row).collect();
    lines.extend(account.foreign.iter().map(|own| {
        let place = own.place.display();
        let what = match own.files {
            1 => format!("foreign: {place}"),
            files => format!("foreign: {place}, a folder of {files} files"),
        };
        own.why.as_ref().map_or_else(|| what.clone(), |why| format!("{what}: {why}"))
    }));
    lines.extend(account.asked.iter().map(|own| format!("asked: {own}")));
    lines.extend(account.temporaries.iter().map(|place| {
        format!(
            "temporary: {}: being written, or left over by a run that was stopped; the next run removes it",
            place.display()
        )
    }));
    lines.push(counts(account, is_whole));
    lines.iter().map(|line| Printable(line).to_string()).collect()
}

fn without_row(run: &WithoutRow) -> String {
    let mut sessions: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for file in &run.files {
        let (table, session) = file.split_once('/').unwrap_or((file, ""));
        sessions.entry(session).or_default().push(table);
    }
    let named = sessions.iter();
    let named = named.map(|(own, tables)| format!("of session {own} {}", tables.join(", ")));
    let files = run.files.len();
    format!(
        "no row: {files} file{} of run {} of robot {} {} no row in runs: the row was deleted, or the run was never committed (it \
         was stopped, or is at work): {}",
        if files == 1 { "" } else { "s" },
        run.run,
        run.robot,
        if files == 1 { "has" } else { "have" },
        named.collect::<Vec<_>>().join("; ")
    )
}

fn counts(account: &FilesOfLake, is_whole: bool) -> String {
    let without_row: usize = account.without_row.iter().map(|run| run.files.len()).sum();
    let foreign: usize = account.foreign.iter().map(|own| own.files).sum();
    let kinds = [
        (account.of_runs, "of runs"),
        (account.of_unread, "of runs whose rows cannot be read"),
        (account.own, "the lake's own"),
        (account.temporaries.len(), "temporary"),
        (without_row, "of runs without a row"),
        (foreign, "foreign"),
    ];
    let counted = kinds.iter().filter(|(count, _)| *count > 0);
    let counted: Vec<String> = counted.map(|(count, kind)| format!("{count} {kind}")).collect();
    let place = if is_whole {
        "in the lake"
    } else {
        "in the folders of these sessions, others not looked at"
    };
    format!("{} files {place}: {}", account.files(), counted.join(", "))
}
