//! One frame of a [`Board`], by the widgets of ratatui.

use std::time::Duration;

use asperity_live::view::{Condition, LiveLayout, Materials, ScopeLayout, SourceView};
use ratatui::buffer::Buffer;
use ratatui::layout::Constraint::{self, Fill, Length, Max};
use ratatui::layout::{Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{
    Axis, Block, Borders, Cell, Chart, Clear, Dataset, GraphType, Padding, Paragraph, Row, Sparkline,
    SparklineBar, Table, TableState, Widget, Wrap,
};
use unicode_width::UnicodeWidthStr;

use crate::board::{self, Board, Tab};
use crate::keys::{HELP, place};
use crate::recent::{Count, Trace};
use crate::text::{bar, clean, clock, dbfs, figure};

/// Least columns and rows of the terminal.
const LEAST: (u16, u16) = (72, 20);
/// From this many rows on, nodes, scopes and parameters are all visible.
const TALL: u16 = 36;
/// From this many columns on, they stand side by side.
const WIDE: u16 = 110;
const NAME: usize = 40;
/// Lowest level of the meter \[dBFS\], and its columns.
const FLOOR_DB: f64 = -60.0;
const METER: usize = 10;

const PLAIN: Style = Style::new();
const FAINT: Style = Style::new().add_modifier(Modifier::DIM);
const BOLD: Style = Style::new().add_modifier(Modifier::BOLD);
/// Faults and losses; always with a word or a sign beside it.
const ALARM: Style = Style::new().fg(Color::Red).add_modifier(Modifier::BOLD);
/// Curves and bars. Magenta and cyan are distinct from each other and from light and dark backgrounds.
const CURVE: Style = Style::new().fg(Color::Cyan);
const CURVE_2: Style = Style::new().fg(Color::Magenta);

/// A word on a coloured background.
const fn badge(color: Color) -> Style {
    Style::new().fg(color).add_modifier(Modifier::BOLD.union(Modifier::REVERSED))
}

fn condition(condition: Condition) -> Span<'static> {
    let (word, color) = match condition {
        Condition::Starting => (" STARTING ", Color::Cyan),
        Condition::Playing => (" PLAYING ", Color::Green),
        Condition::Muted => (" MUTED ", Color::Magenta),
        Condition::Lost => (" DEVICE LOST ", Color::Red),
        Condition::Stopping => (" STOPPING ", Color::Cyan),
        Condition::Failed => (" FAILED ", Color::Red),
    };
    Span::styled(word, badge(color))
}

/// The head of a pane, a bold title and plain text on a line. Answers the area below it.
fn pane(title: &str, more: &str, area: Rect, buffer: &mut Buffer) -> Rect {
    let title = Line::from(vec![Span::styled(format!(" {title} "), BOLD), Span::raw(format!("{more} "))]);
    let block = Block::new().borders(Borders::TOP).border_style(FAINT).title(title);
    let inner = block.inner(area);
    block.render(area, buffer);
    inner
}

fn right(text: String, style: Style) -> Cell<'static> {
    Cell::from(Line::styled(text, style).right_aligned())
}

fn faint<const N: usize>(titles: [&'static str; N]) -> [Cell<'static>; N] {
    titles.map(|title| right(title.into(), FAINT))
}

/// A row that begins with a name.
fn row(name: &str, style: Style, rest: impl IntoIterator<Item = Cell<'static>>) -> Row<'static> {
    Row::new([Cell::from(Span::styled(clean(name, NAME), style))].into_iter().chain(rest))
}

/// A figure, red beyond a limit.
fn limited(x: f64, limit: f64) -> Cell<'static> {
    let over = limit > 0.0 && x > limit;
    right(if over { "!" } else { "" }.to_owned() + &figure(x), if over { ALARM } else { PLAIN })
}

impl Board {
    /// Draws the frame of `time` into an empty buffer.
    pub(crate) fn draw(&mut self, buffer: &mut Buffer, time: Duration) {
        let area = buffer.area;
        if area.width < LEAST.0 || area.height < LEAST.1 {
            return self.draw_small(area, buffer, time);
        }
        let tall = area.height >= TALL;
        let (top, notes) =
            if tall { ((area.height / 4).clamp(9, 14), area.height / 12) } else { (area.height * 2 / 5, 1) };
        let rows = [Length(1), Length(1), Length(top), Fill(1), Length(notes), Length(1)];
        let [title, meters, top, body, said, keys] = Layout::vertical(rows).areas(area);
        self.draw_title(title, buffer);
        self.draw_meters(meters, buffer, time);
        self.draw_top(top, buffer, time);
        self.draw_body(body, buffer, time, tall);
        let from = self.notes.len().saturating_sub(usize::from(notes));
        let note = |(seconds, text): &(f64, String)| {
            let time = Span::styled(format!(" {}  ", clock(*seconds)), FAINT);
            Line::from(vec![time, Span::raw(clean(text, area.width.into()))])
        };
        Paragraph::new(self.notes.range(from..).map(note).collect::<Vec<_>>()).render(said, buffer);
        self.draw_keys(keys, buffer, tall);
        if self.help {
            draw_help(area, buffer);
        }
    }

    fn draw_small(&self, area: Rect, buffer: &mut Buffer, time: Duration) {
        let lost = if self.counts.iter().any(|count| count.rose(time)) { "! something was lost" } else { "" };
        let small = format!("The terminal is too small: {} x {}.", area.width, area.height);
        let lines = vec![
            condition(self.view.condition).into(),
            Line::styled(small, BOLD),
            Line::raw(format!("The figures need {} x {}.", LEAST.0, LEAST.1)),
            Line::styled(lost, ALARM),
            Line::styled("q stop  space mute", FAINT),
        ];
        Paragraph::new(lines).render(area, buffer);
    }

    fn draw_title(&self, area: Rect, buffer: &mut Buffer) {
        let (view, layout) = (&self.view, &self.layout);
        let time = Span::styled(format!(" {} ", clock(view.seconds)), BOLD);
        let end = Line::from(vec![condition(view.condition), time]);
        let [start, right] = Layout::horizontal([Fill(1), Length(end.width() as u16)]).areas(area);
        end.render(right, buffer);
        let device = if view.device.is_empty() { "no device" } else { &view.device };
        let mut about = format!(" · {} · {}", clean(device, NAME), clean(&view.clock, NAME));
        if view.period_frames > 0 {
            about += &format!(" {}", view.period_frames);
        }
        about += &format!(" · {} Hz", layout.tick_hz);
        if layout.audio_hz > 0 && area.width >= 100 {
            about += &format!(", audio {} Hz", layout.audio_hz);
        }
        // The end of a path says most. Room is left for the text beside it.
        let room = usize::from(start.width);
        let room = room.saturating_sub(about.width() + 2).max(room / 3);
        let mut file: String = clean(&layout.file, usize::MAX / 16).chars().rev().take(room).collect();
        while file.width() > room {
            file.pop();
        }
        let file = Span::styled(format!(" {}", file.chars().rev().collect::<String>()), BOLD);
        Line::from(vec![file, Span::raw(about)]).render(start, buffer);
    }

    fn draw_meters(&self, area: Rect, buffer: &mut Buffer, time: Duration) {
        let held = self.peak.value;
        // From 1 on samples were clipped; NaN is worse.
        let over = held >= 1.0 || held.is_nan();
        let full = 1.0 - dbfs(self.view.peak).clamp(FLOOR_DB, 0.0) / FLOOR_DB;
        let mut words = vec![
            Span::styled(" peak ", FAINT),
            Span::styled(bar(full, METER), if over { ALARM } else { CURVE }),
            Span::styled(format!(" {:.1} dBFS", dbfs(held)), if over { ALARM } else { PLAIN }),
            Span::styled(if over { "!" } else { " " }, ALARM),
        ];
        for (name, count) in ["underruns", "lost", "xruns", "losses", "faults"].into_iter().zip(&self.counts)
        {
            let style = match (count.rose(time), count.now) {
                (true, _) => ALARM,
                (_, 1..) => BOLD,
                // Where there is little room, zeros are left out.
                _ if area.width < 100 => continue,
                _ => FAINT,
            };
            words.push(Span::styled(format!("  {name} "), FAINT));
            words.push(Span::styled(figure(count.now as f64), style));
            words.push(Span::styled(if count.rose(time) { "!" } else { " " }, ALARM));
        }
        Line::from(words).render(area, buffer);
    }

    fn draw_top(&self, area: Rect, buffer: &mut Buffer, time: Duration) {
        let wide = area.width >= WIDE;
        let [left, rest] =
            Layout::horizontal([Max(if wide { 80 } else { 42 }), Fill(1)]).spacing(1).areas(area);
        let split =
            if wide { Layout::horizontal([Fill(2), Fill(3)]) } else { Layout::vertical([Fill(1); 2]) };
        let [latency, sources] = split.spacing(u16::from(wide)).areas(rest);
        self.draw_timing(left, buffer, time);
        self.draw_latency(latency, buffer);
        self.draw_sources(sources, buffer, time);
    }

    /// Computing time and lateness of ticks, against the deadline.
    fn draw_timing(&self, area: Rect, buffer: &mut Buffer, time: Duration) {
        let timing = &self.view.timing;
        let inner = pane("timing", &format!("deadline {} us", figure(timing.deadline_us)), area, buffer);
        let [figures, misses, late, computing] =
            Layout::vertical([Length(3), Length(1), Fill(1), Fill(1)]).areas(inner);
        let rows = [("late", CURVE, timing.late_us), ("computing", CURVE_2, timing.compute_us)];
        let rows =
            rows.map(|(name, style, us)| row(name, style, us.map(|us| limited(us, timing.deadline_us))));
        Table::new(rows, [Length(9), Max(8), Max(8), Max(8), Max(8)])
            .header(row("", FAINT, faint(["p50", "p99", "p99.9", "max us"])))
            .render(figures, buffer);
        let rose = self.counts[5].rose(time);
        let style = if rose { ALARM } else { BOLD };
        let share = 100.0 * timing.misses as f64 / self.view.ticks.max(1) as f64;
        let count = format!("{}{}", if rose { "!" } else { "" }, figure(timing.misses as f64));
        let woke = figure(timing.woke_late as f64);
        let slow = figure(timing.misses.saturating_sub(timing.woke_late) as f64);
        Line::from(vec![
            Span::styled("misses ", FAINT),
            Span::styled(count, style),
            Span::raw(format!(" = {} %: {woke} woke late, {slow} slow", figure(share))),
        ])
        .render(misses, buffer);
        self.draw_histogram(("late", CURVE), &timing.late_counts, late, buffer);
        self.draw_histogram(("computing", CURVE_2), &timing.compute_counts, computing, buffer);
    }

    /// Ticks by time, an octave a bar from the first that both histograms share. Heights are logarithmic: one
    /// late tick in a million is visible, and red.
    fn draw_histogram(&self, head: (&str, Style), counts: &[u64], area: Rect, buffer: &mut Buffer) {
        let timing = &self.view.timing;
        let full = |counts: &[u64]| counts.iter().position(|n| *n > 0).unwrap_or(usize::MAX);
        let first = full(&timing.late_counts).min(full(&timing.compute_counts));
        let edge = |bin: usize| timing.edges_us.get(bin.checked_sub(1)?).copied();
        let [name, bars] = Layout::horizontal([Length(10), Fill(1)]).areas(area);
        let from = edge(first).map_or(String::new(), |us| format!("{} us on", figure(us)));
        Paragraph::new(vec![Line::styled(head.0, head.1), Line::styled(from, FAINT)]).render(name, buffer);
        let width = (usize::from(bars.width) / timing.edges_us.len().max(1)).clamp(1, 3);
        let bar = |(bin, n): (usize, &u64)| {
            let late = edge(bin).is_some_and(|us| timing.deadline_us > 0.0 && us >= timing.deadline_us);
            let height = (1e6 * (*n as f64).ln_1p()) as u64;
            SparklineBar::from(height).style(if late { ALARM } else { head.1 })
        };
        let all = counts.iter().enumerate().skip(first).map(bar);
        Sparkline::default().data(all.flat_map(|bar| std::iter::repeat_n(bar, width))).render(bars, buffer);
    }

    fn draw_latency(&self, area: Rect, buffer: &mut Buffer) {
        let items = &self.view.latency_ms;
        let sum: f64 = items.iter().map(|(_, ms)| ms).sum();
        let known = |of: String| if items.is_empty() { String::new() } else { of };
        let inner = pane("latency", &known(format!("{sum:.1} ms declared, hand to actuator")), area, buffer);
        let all: Vec<String> =
            items.iter().map(|(name, ms)| format!("{} {ms:.1}", clean(name, NAME))).collect();
        let text = if items.is_empty() { "not known yet".to_owned() } else { all.join(" + ") };
        let text = text + &known(format!(" = {sum:.1} ms"));
        Paragraph::new(text)
            .wrap(Wrap { trim: true })
            .block(Block::new().padding(Padding::left(1)))
            .render(inner, buffer);
    }

    fn draw_sources(&self, area: Rect, buffer: &mut Buffer, time: Duration) {
        let rows = usize::from(area.height).saturating_sub(2);
        let many = self.view.sources.len();
        let more = if many > rows { format!("{rows} of {many}") } else { String::new() };
        let inner = pane("sources", &more, area, buffer);
        if many == 0 {
            return Line::styled(" none: no hand", FAINT).render(inner, buffer);
        }
        // A source that has not begun is not stalled. Stalled ones come first, so that they are visible.
        let stalls = |s: &SourceView, count: &Count| (s.stalled && s.samples > 0) || count.rose(time);
        let mut all: Vec<_> = self.view.sources.iter().zip(&self.stalls).collect();
        all.sort_by_key(|(source, count)| !stalls(source, count));
        let shown = |(s, count): (&SourceView, &Count)| {
            let rate = match s.samples {
                _ if stalls(s, count) => right("STALLED".into(), ALARM),
                0 => right("waits".into(), FAINT),
                _ => right(figure(s.rate_hz.round()), PLAIN),
            };
            let style = if s.stalls > 0 { BOLD } else { FAINT };
            let [age, delay] = [s.age_ms, s.delay_ms].map(|ms| right(format!("{ms:.1}"), PLAIN));
            row(&s.id, PLAIN, [rate, age, delay, right(figure(s.stalls as f64), style)])
        };
        Table::new(all.into_iter().map(shown), [Max(24), Length(7), Length(6), Length(6), Length(6)])
            .header(row("id", FAINT, faint(["Hz", "age ms", "delay", "stalls"])))
            .block(Block::new().padding(Padding::left(1)))
            .render(inner, buffer);
    }

    fn draw_body(&mut self, area: Rect, buffer: &mut Buffer, time: Duration, tall: bool) {
        self.all_seen = tall;
        if !tall {
            return match self.tab {
                Tab::Nodes => self.draw_nodes(area, buffer, time),
                Tab::Scopes => self.draw_scopes(area, buffer),
                Tab::Parameters => self.draw_parameters(area, buffer),
            };
        }
        // Nodes and parameters take the rows they need. Scopes get the rest, at least two fifths.
        let list = (self.layout.nodes.len() as u16 + 2).max(9).min(area.height * 3 / 5);
        let [upper, lower] = Layout::vertical([Length(list), Fill(1)]).areas(area);
        let beside = |area, of| Layout::horizontal(of).spacing(1).areas::<2>(area);
        let (nodes, parameters, scopes) = if area.width >= WIDE {
            let [nodes, parameters] = beside(upper, [Fill(2), Fill(1)]);
            (nodes, parameters, lower)
        } else {
            let [parameters, scopes] = beside(lower, [Fill(9), Fill(11)]);
            (upper, parameters, scopes)
        };
        self.draw_nodes(nodes, buffer, time);
        self.draw_parameters(parameters, buffer);
        self.draw_scopes(scopes, buffer);
    }

    /// The nodes, in the order of their calls.
    fn draw_nodes(&mut self, area: Rect, buffer: &mut Buffer, time: Duration) {
        let (many, rows) = (self.layout.nodes.len(), usize::from(area.height).saturating_sub(2));
        self.page = rows.max(1);
        self.scroll = self.scroll.min(many.saturating_sub(rows));
        let to = (self.scroll + rows).min(many);
        let mut more = match many {
            0 => "none".into(),
            _ if rows < many => format!("{} to {to} of {many}, PgUp PgDn", self.scroll + 1),
            _ => many.to_string(),
        };
        let out = self.rows.iter().filter(|row| row.last.quarantined).count();
        if out > 0 {
            more += &format!(", {out} out of use");
        }
        let inner = pane("nodes", &more, area, buffer);
        let nodes = || self.layout.nodes.iter();
        let id = nodes().map(|node| clean(&node.id, NAME).width()).max().unwrap_or(0).max(2);
        let kind = nodes().map(|node| clean(&node.kind, NAME).width()).max().unwrap_or(0).max(4);
        // Where not both fit, the id has priority.
        let names = usize::from(area.width).saturating_sub(62);
        let kind = kind.min(names.saturating_sub(id).max(names * 2 / 5));
        let mut widths = vec![Length(id.min(names.saturating_sub(kind)) as u16), Length(kind as u16)];
        widths.extend([6, 6, 6, 6, 6, 6].map(Length));
        widths.push(Fill(1));
        let shown = nodes().zip(&self.rows).take(to).skip(self.scroll).map(|(node, row)| {
            let unit = node.outputs.first().map_or("", |[_, unit]| unit);
            node_row(&node.id, &node.kind, unit, row, time)
        });
        let titles = faint(["us", "max us", "% tick", "calls", "asleep", "faults"]);
        let kind = Cell::from(Span::styled("kind", FAINT));
        let titles = [kind].into_iter().chain(titles).chain([Cell::from(Span::styled("   value", FAINT))]);
        Table::new(shown, widths)
            .header(row("id", FAINT, titles))
            .block(Block::new().padding(Padding::left(1)))
            .render(inner, buffer);
    }

    fn draw_parameters(&self, area: Rect, buffer: &mut Buffer) {
        let many = self.parameters().count();
        let more = if many == 0 { "none".into() } else { format!("{} of {many}", self.chosen + 1) };
        let textures = self.layout.materials.len().min(3) as u16;
        let below = if textures > 0 { textures + 1 } else { 0 };
        let [list, materials] = Layout::vertical([Fill(1), Length(below)]).areas(area);
        let inner = pane("parameters", &more, list, buffer);
        let range = if area.width >= 56 { (area.width / 4).min(30) } else { 0 };
        let rows = self.parameters().map(|(node, live)| parameter_row(&node.id, live));
        let table = Table::new(rows, [Fill(1), Length(10), Length(8), Length(range)])
            .highlight_symbol("> ")
            .row_highlight_style(BOLD);
        let mut state = TableState::new().with_selected(self.chosen);
        ratatui::widgets::StatefulWidget::render(table, inner, buffer, &mut state);
        if textures > 0 {
            let inner = pane("materials", "", materials, buffer);
            let from = (self.texture + 1).saturating_sub(textures.into());
            let all = self.layout.materials.iter().enumerate().skip(from);
            let lines: Vec<Line> = all.map(|(k, m)| material_line(m, k == self.texture)).collect();
            Paragraph::new(lines).render(inner, buffer);
        }
    }

    fn draw_scopes(&self, area: Rect, buffer: &mut Buffer) {
        let many = self.traces.len();
        let across = (usize::from(area.width) / 36).clamp(1, many.max(1));
        let down = many.div_ceil(across).min(usize::from(area.height) / 4).max(1);
        let across = across.min(many.div_ceil(down)).max(1);
        let shown = many.min(across * down);
        let more = match many {
            0 => "none".into(),
            _ if shown < many => format!("{shown} of {many}, last 2 s"),
            _ => "last 2 s".into(),
        };
        let inner = pane("scopes", &more, area, buffer);
        let rows = Layout::vertical(vec![Fill(1); down]).split(inner);
        let cells =
            rows.iter().flat_map(|row| Layout::horizontal(vec![Fill(1); across]).split(*row).to_vec());
        for ((scope, trace), area) in self.layout.scopes.iter().zip(&self.traces).zip(cells) {
            draw_scope(scope, trace, area, buffer);
        }
    }

    fn draw_keys(&self, area: Rect, buffer: &mut Buffer, tall: bool) {
        let keys = [("q", "stop"), ("space", "mute"), ("↑↓←→", "set"), ("n p", "material"), ("?", "help")];
        let mut words: Vec<Span> = keys
            .iter()
            .flat_map(|(key, does)| {
                [Span::styled(format!(" {key} "), BOLD), Span::styled(format!("{does} "), FAINT)]
            })
            .collect();
        let tabs = [(Tab::Nodes, "1 nodes"), (Tab::Scopes, "2 scopes"), (Tab::Parameters, "3 set")];
        for (tab, name) in tabs.into_iter().filter(|_| !tall) {
            words.push(Span::raw(" "));
            words.push(Span::styled(name, if tab == self.tab { badge(Color::Reset) } else { FAINT }));
        }
        Line::from(words).render(area, buffer);
    }
}

fn node_row(id: &str, kind: &str, unit: &str, row: &board::Row, time: Duration) -> Row<'static> {
    let node = &row.last;
    let idle = node.calls == 0;
    let asleep = row.us == 0.0 && row.asleep > 0.0;
    let shown = |x: f64, known: bool| right(if known { figure(x) } else { "-".into() }, PLAIN);
    let fault = row.faults.rose(time);
    let (text, style) = match row.value {
        _ if node.quarantined => (format!("OUT: {}", node.last_fault), ALARM),
        _ if fault => (format!("! {}", node.last_fault), ALARM),
        Some(x) => (format!("{:>8} {unit}", figure(x.into())), if x.is_finite() { PLAIN } else { ALARM }),
        None => (String::new(), PLAIN),
    };
    let percent = |share: f64| (1e3 * share).round() / 10.0;
    let figures = [
        Cell::from(Span::styled(clean(kind, NAME), FAINT)),
        shown((10.0 * row.us).round() / 10.0, !idle && !asleep),
        shown((10.0 * node.max_us).round() / 10.0, !idle),
        shown((1e5 * row.share).round() / 1e3, !idle),
        right(figure(node.calls as f64), PLAIN),
        right(if row.asleep > 0.0 { format!("{} %", percent(row.asleep)) } else { "-".into() }, PLAIN),
        right(figure(node.faults as f64), if fault { ALARM } else { PLAIN }),
        Cell::from(Span::styled(clean(&text, 2 * NAME), style)),
    ];
    self::row(id, PLAIN, figures).style(if node.quarantined { ALARM } else { PLAIN })
}

fn parameter_row(node: &str, live: &LiveLayout) -> Row<'static> {
    let [least, most] = live.slide();
    let (slider, value, range) = match live.words.get(live.value.round().max(0.0) as usize) {
        Some(word) => (clean(word, NAME), String::new(), live.words.join(" ")),
        None if live.words.is_empty() => {
            let range = format!("{} .. {} {}", figure(least), figure(most), live.unit);
            (bar(place(live), 10), figure(live.value), range)
        }
        None => ("?".into(), String::new(), live.words.join(" ")),
    };
    let range = Cell::from(Span::styled(clean(&range, NAME), FAINT));
    row(&format!("{node}.{}", live.name), PLAIN, [Cell::from(slider), right(value, PLAIN), range])
}

fn material_line(materials: &Materials, chosen: bool) -> Line<'static> {
    let at = materials.names.iter().position(|name| *name == materials.chosen);
    let place = at.map_or("?".into(), |at| (at + 1).to_string());
    let mut words = vec![
        Span::styled(if chosen { "> " } else { "  " }, BOLD),
        Span::styled(clean(&materials.node, 20), if chosen { BOLD } else { PLAIN }),
        Span::styled(format!(" {place} of {} ", materials.names.len()), FAINT),
        Span::styled(format!(" {} ", clean(&materials.chosen, NAME)), badge(Color::Reset)),
    ];
    // The next materials, as far as there is room.
    let after = materials.names.iter().cycle().skip(at.map_or(0, |at| at + 1));
    let after = after.take(materials.names.len().saturating_sub(1).min(20));
    words.extend(after.map(|name| Span::styled(format!("  {}", clean(name, NAME)), FAINT)));
    Line::from(words)
}

fn draw_scope(scope: &ScopeLayout, trace: &Trace, area: Rect, buffer: &mut Buffer) {
    let [low, high] = trace.bounds();
    let peak = format!(" peak {} {}", figure(trace.peak().into()), clean(&scope.unit, NAME));
    let title = Line::from(vec![Span::raw(clean(&scope.name, NAME)), Span::styled(peak, FAINT)]);
    let lines = trace.lines();
    let curve =
        |line| Dataset::default().marker(Marker::Braille).graph_type(GraphType::Line).style(CURVE).data(line);
    Chart::new(lines.iter().map(|line| curve(line)).collect())
        .block(Block::new().title(title))
        .x_axis(Axis::default().bounds([-2.0, 0.0]))
        .y_axis(Axis::default().bounds([low, high]).labels([figure(low), figure(high)]).style(FAINT))
        .legend_position(None)
        .render(area, buffer);
}

/// The help: all keys, over the rest of the frame.
fn draw_help(area: Rect, buffer: &mut Buffer) {
    let area = area.centered(Constraint::Length(62), Constraint::Length(HELP.len() as u16 + 3));
    Clear.render(area, buffer);
    let rows = HELP.map(|(keys, action)| Row::new([Span::styled(keys, BOLD), Span::raw(action)]));
    Table::new(rows, [Length(16), Fill(1)])
        .footer(Row::new(["!", "marks a loss or a deadline miss of the last 2 s"]).style(FAINT))
        .block(Block::bordered().border_style(FAINT).title(Span::styled(" keys ", BOLD)))
        .render(area, buffer);
}

#[cfg(test)]
mod tests;
