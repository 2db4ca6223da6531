//! The page. It contains its figures, so that it is one file.

use std::fmt::Write as _;

use evaluation::page::{END, styled_head};
use picture::escape;

use crate::{
    content::Content,
    events::{Event, FAILSAFE},
    figures::Figure,
    metrics,
};

/// Most rows of the list of events. The time line shows more.
const MOST_EVENTS: usize = 100;
/// Most characters of a text from the recording.
const LONGEST: usize = 500;

/// Nothing is wider than the page, and nothing is cut by the end of a sheet.
const STYLE: &str = "body{max-width:46rem;overflow-wrap:anywhere}figure{display:block;width:auto;margin:1.5em 0;break-inside:avoid}\
figure svg{display:block;max-width:100%;height:auto;margin:0 auto}figcaption{font-size:.9em;color:#323f4b;margin-top:.4em}\
table{display:table;width:100%;font-size:.9em}td,th{overflow-wrap:normal;padding:.25em .5em}td:last-child{overflow-wrap:anywhere}tr{break-inside:avoid}thead{display:table-header-group}\
.remark{border:2px solid #1f2933;padding:.5em .8em;font-weight:600}h2{break-after:avoid}\
@page{margin:16mm}@media print{body{max-width:none;margin:0;padding:0;font-size:10.5pt}figure svg{max-height:175mm}}";

/// The page of `content` with `figures`.
pub(crate) fn html(content: &Content, figures: &[Figure]) -> String {
    let title = format!("Report: {}", content.mission.name);
    let mut page = styled_head(&title, STYLE);
    // Writing to a String cannot fail.
    let _ = writeln!(page, "<h1>{}</h1>", text(&title));
    let _ = writeln!(page, "<p>{}</p>", text(&outcome(content)));
    for remark in &content.remarks {
        let _ = writeln!(page, "<p class=\"remark\">{}</p>", text(remark));
    }
    for figure in figures {
        let _ = writeln!(
            page,
            "<figure id=\"{}\">\n{}<figcaption>{}</figcaption></figure>",
            figure.name,
            inline(&figure.svg),
            text(&figure.caption)
        );
    }
    let stride = content.poses.stride();
    if stride > 1 {
        let _ = writeln!(page, "<p>Curves show one of {stride} samples; metrics count all.</p>");
    }
    page.push_str("<h2>Metrics</h2>\n<table><thead><tr><th>metric</th><th>value</th><th>field or source</th></tr></thead><tbody>\n");
    for metric in metrics::table(content) {
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td>{}</td><td><code>{}</code></td></tr>",
            text(metric.name),
            text(&metric.value),
            text(metric.field)
        );
    }
    page.push_str("</tbody></table>\n<h2>Events</h2>\n");
    events(&mut page, content);
    page.push_str("<h2>Run</h2>\n<table><tbody>\n");
    for (what, which) in &content.about {
        let _ = writeln!(page, "<tr><th>{what}</th><td>{}</td></tr>", text(which));
    }
    page.push_str("</tbody></table>\n");
    page.push_str(END);
    page
}

fn outcome(content: &Content) -> String {
    let reason = content.summary.get("reason");
    let reason = reason.and_then(serde_json::Value::as_str);
    match (content.outcome(), reason) {
        (Some(outcome), Some(reason)) => format!("{outcome}: {reason}"),
        (Some(outcome), None) => outcome.to_owned(),
        (None, _) => "No summary of this run lies beside the recording: how it ended is not known here, and metrics are those of the recording.".to_owned(),
    }
}

fn events(page: &mut String, content: &Content) {
    // Surplus events of the failsafe are left out first: it may stop the robot for moments throughout a run.
    let told = content.events.all.iter();
    let told = told.filter(|event| !event.text.is_empty());
    let (failsafe, others): (Vec<&Event>, Vec<_>) = told.partition(|event| event.lane == FAILSAFE);
    let count = failsafe.len() + others.len();
    let mut listed: Vec<_> = others.into_iter().chain(failsafe).take(MOST_EVENTS).collect();
    listed.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    page.push_str(
        "<table><thead><tr><th>time, s</th><th>of</th><th>what</th></tr></thead><tbody>\n",
    );
    for event in &listed {
        let _ = writeln!(
            page,
            "<tr><td>{:.2}</td><td>{}</td><td>{}</td></tr>",
            event.time_s,
            text(&event.lane),
            text(&event.text)
        );
    }
    page.push_str("</tbody></table>\n");
    let more = (count - listed.len()) as u64;
    let more = more.saturating_add(content.events.left_out);
    if more > 0 {
        let _ = writeln!(page, "<p>{more} more events are not listed.</p>");
    }
}

/// `of` escaped, at most [`LONGEST`] characters.
fn text(of: &str) -> String {
    escape(of, LONGEST)
}

/// An SVG file as part of a page, where its namespace is known.
fn inline(svg: &str) -> String {
    svg.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1)
}
