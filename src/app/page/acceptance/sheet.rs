//! Texts and tables → the pages of a PDF with an embedded font. Lengths are in points, from a page's upper left corner. The same content
//! gives the same bytes: nothing of the clock or of chance is in them.

use krilla::Document;
use krilla::color::rgb;
use krilla::error::KrillaError;
use krilla::geom::{PathBuilder, Point, Rect};
use krilla::metadata::Metadata;
use krilla::page::PageSettings;
use krilla::paint::Fill;
use krilla::surface::Surface;
use krilla::text::{Font, GlyphId, KrillaGlyph};
use skrifa::instance::{LocationRef, Size};
use skrifa::{FontRef, MetadataProvider as _};

use crate::manifest::VERSION;
use crate::page::shell::is_hidden;

const FONTS: [&[u8]; 2] = [
    include_bytes!("font/DejaVuSansCondensed.ttf"),
    include_bytes!("font/DejaVuSansCondensed-Bold.ttf"),
];

/// A4.
const PAGE: [f32; 2] = [595.28, 841.89];
const MARGIN: f32 = 40.0;
const WIDTH: f32 = PAGE[0] - 2.0 * MARGIN;
const FOOT: f32 = PAGE[1] - MARGIN;
/// Height of a line divided by the size of its letters.
const LEADING: f32 = 1.22;
/// Space around the text of a table's cell.
const GAP: f32 = 2.2;
/// Most characters of one text: names in files have any length.
const LONGEST: usize = 400;

pub(super) type Colour = [u8; 3];
const GROUND: Colour = [234, 237, 241];
const RULE: Colour = [190, 194, 200];

/// The size of letters, and whether they are bold.
pub(super) type Look = (f32, bool);

/// The heading of a table's column, and its share of the width.
pub(super) type Column<'c> = (&'c str, f32);

enum Mark {
    Text([f32; 2], String, Look),
    /// Left, top, right and bottom.
    Block([f32; 4], Colour),
}

pub(super) struct Sheet {
    faces: [FontRef<'static>; 2],
    pages: Vec<Vec<Mark>>,
    /// Where the next line begins on the last page.
    y: f32,
}

impl Sheet {
    pub(super) fn new() -> Self {
        let faces = FONTS.map(|bytes| FontRef::new(bytes).expect("a test reads the fonts"));
        Self { faces, pages: vec![Vec::new()], y: MARGIN }
    }

    /// Lines over the whole width, and space below them.
    pub(super) fn text(&mut self, text: &str, look: Look) {
        for line in self.lines(text, look, WIDTH) {
            self.room(look.0 * LEADING);
            self.mark(Mark::Text([MARGIN, self.y + look.0], line, look));
            self.y += look.0 * LEADING;
        }
        self.y += 4.0;
    }

    /// A heading, on a page with room for what follows it.
    pub(super) fn heading(&mut self, text: &str) {
        self.room(48.0);
        self.y += 6.0;
        self.text(text, (11.5, true));
    }

    /// A bold line on a coloured ground.
    pub(super) fn band(&mut self, text: &str, colour: Colour) {
        self.room(30.0);
        let area = [MARGIN, self.y, PAGE[0] - MARGIN, self.y + 24.0];
        self.mark(Mark::Block(area, colour));
        self.mark(Mark::Text([MARGIN + 8.0, self.y + 16.0], self.shown(text), (12.0, true)));
        self.y += 30.0;
    }

    /// A table with its first column bold, whose headings stand again on every page that it goes on to.
    pub(super) fn table(&mut self, columns: &[Column<'_>], rows: &[Vec<String>], size: f32) {
        let head: Vec<String> = columns.iter().map(|own| own.0.to_owned()).collect();
        let head = Some(head).filter(|own| own.iter().any(|text| !text.is_empty()));
        self.room(60.0);
        for (place, cells) in head.iter().chain(rows).enumerate() {
            let is_head = place == 0 && head.is_some();
            let lines = self.cells(columns, cells, (size, is_head));
            let height = row_height(&lines, size);
            if self.room(height)
                && let Some(head) = head.as_ref().filter(|_| !is_head)
            {
                let lines = self.cells(columns, head, (size, true));
                self.row(columns, lines, size, true);
            }
            self.row(columns, lines, size, is_head);
        }
        self.y += 5.0;
    }

    fn cells(&self, columns: &[Column<'_>], cells: &[String], look: Look) -> Vec<Vec<String>> {
        let lines = columns.iter().zip(cells).enumerate().map(|(place, ((_, share), cell))| {
            self.lines(cell, (look.0, look.1 || place == 0), share * WIDTH - 2.0 * GAP)
        });
        lines.collect()
    }

    fn row(&mut self, columns: &[Column<'_>], cells: Vec<Vec<String>>, size: f32, is_head: bool) {
        let (mut x, top, right) = (MARGIN, self.y, PAGE[0] - MARGIN);
        self.y += row_height(&cells, size);
        let height = if is_head { self.y - top } else { 0.5 };
        let colour = if is_head { GROUND } else { RULE };
        self.mark(Mark::Block([MARGIN, self.y - height, right, self.y], colour));
        for (place, ((_, share), lines)) in columns.iter().zip(cells).enumerate() {
            for (number, line) in lines.into_iter().enumerate() {
                let y = top + GAP + size * (1.0 + number as f32 * LEADING);
                self.mark(Mark::Text([x + GAP, y], line, (size, is_head || place == 0)));
            }
            x += share * WIDTH;
        }
    }

    /// Begins a page where the last one has no room for this height, and tells whether it did.
    fn room(&mut self, height: f32) -> bool {
        let is_full = self.y + height > FOOT - 14.0;
        if is_full {
            self.pages.push(Vec::new());
            self.y = MARGIN;
        }
        is_full
    }

    fn mark(&mut self, mark: Mark) {
        self.pages.last_mut().expect("there is a page from the start").push(mark);
    }

    /// The text in lines that are no wider; a word that is wider is broken.
    fn lines(&self, text: &str, look: Look, width: f32) -> Vec<String> {
        let (mut lines, mut line) = (Vec::new(), String::new());
        for word in self.shown(text).split_inclusive(' ') {
            if !line.is_empty() && self.width(&format!("{line}{}", word.trim_end()), look) > width {
                lines.push(std::mem::take(&mut line));
            }
            for letter in word.chars() {
                line.push(letter);
                if letter != ' '
                    && line.len() > letter.len_utf8()
                    && self.width(&line, look) > width
                {
                    line.pop();
                    lines.push(std::mem::replace(&mut line, letter.to_string()));
                }
            }
        }
        lines.push(line);
        lines
    }

    /// The text as it can be drawn: characters that the font lacks or nobody sees are code points, one that is very long is cut.
    fn shown(&self, text: &str) -> String {
        let letters = text.chars().count();
        let drawn = text.chars().take(LONGEST).map(|c| {
            let is_there = self.faces.iter().all(|face| face.charmap().map(c).is_some());
            if is_there && !is_hidden(c) { c.to_string() } else { format!("[U+{:04X}]", c as u32) }
        });
        let drawn: String = drawn.collect();
        if letters > LONGEST { format!("{drawn}… ({letters} characters)") } else { drawn }
    }

    fn width(&self, text: &str, look: Look) -> f32 {
        look.0 * self.glyphs(text, look).iter().map(|glyph| glyph.x_advance).sum::<f32>()
    }

    fn glyphs(&self, text: &str, (_, is_bold): Look) -> Vec<KrillaGlyph> {
        let face = &self.faces[usize::from(is_bold)];
        let metrics = face.glyph_metrics(Size::new(1.0), LocationRef::default());
        let glyph = |(start, letter): (usize, char)| {
            let id = face.charmap().map(letter).unwrap_or_default();
            let range = start..start + letter.len_utf8();
            let advance = metrics.advance_width(id).unwrap_or_default();
            KrillaGlyph::new(GlyphId::new(id.to_u32()), advance, 0.0, 0.0, 0.0, range, None)
        };
        text.char_indices().map(glyph).collect()
    }

    /// The file; the title stands below every page, before its number.
    pub(super) fn finish(mut self, title: &str) -> Result<Vec<u8>, KrillaError> {
        let fonts = FONTS.map(|bytes| Font::new(bytes.into(), 0).expect("a test reads the fonts"));
        let about = Metadata::new().title(self.shown(title)).language("en".to_owned());
        let mut document = Document::new();
        document.set_metadata(about.producer(format!("posegrid {VERSION}")));
        let pages = std::mem::take(&mut self.pages);
        for (place, marks) in pages.iter().enumerate() {
            let settings = PageSettings::from_wh(PAGE[0], PAGE[1]).expect("A4 has a size");
            let mut page = document.start_page_with(settings);
            let mut surface = page.surface();
            let foot = format!("page {} of {} · {title}", place + 1, pages.len());
            let foot = self.lines(&foot, (7.0, false), WIDTH).swap_remove(0);
            for mark in marks.iter().chain([&Mark::Text([MARGIN, FOOT], foot, (7.0, false))]) {
                self.draw(mark, &fonts, &mut surface);
            }
        }
        document.finish()
    }

    fn draw(&self, mark: &Mark, fonts: &[Font; 2], surface: &mut Surface<'_>) {
        let fill = |[r, g, b]: Colour| {
            Some(Fill { paint: rgb::Color::new(r, g, b).into(), ..Fill::default() })
        };
        match mark {
            Mark::Text([x, y], text, look) => {
                surface.set_fill(fill([0, 0, 0]));
                let (glyphs, font) = (self.glyphs(text, *look), fonts[usize::from(look.1)].clone());
                surface.draw_glyphs(Point::from_xy(*x, *y), &glyphs, font, text, look.0, false);
            }
            Mark::Block([left, top, right, bottom], colour) => {
                let mut path = PathBuilder::new();
                if let Some(area) = Rect::from_ltrb(*left, *top, *right, *bottom) {
                    path.push_rect(area);
                }
                surface.set_fill(fill(*colour));
                if let Some(path) = path.finish() {
                    surface.draw_path(&path);
                }
            }
        }
    }
}

fn row_height(cells: &[Vec<String>], size: f32) -> f32 {
    let lines = cells.iter().map(Vec::len).max().unwrap_or(1);
    lines as f32 * size * LEADING + 2.0 * GAP
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_font_lacks_is_a_code_point_and_a_long_name_is_cut_and_broken() {
        let sheet = Sheet::new();
        assert_eq!(sheet.shown("臂\u{202e}ab\n"), "[U+81C2][U+202E]ab[U+000A]");
        let name = "x".repeat(1000);
        let long = sheet.shown(&name);
        assert!(long.ends_with("… (1000 characters)"), "{long}");
        let own = (8.0, false);
        let lines = sheet.lines(&name, own, 100.0);
        assert!(lines.iter().all(|line| sheet.width(line.trim_end(), own) <= 100.0));
        assert_eq!(lines.concat(), long);
    }

    #[test]
    fn a_table_goes_on_to_the_next_page_and_the_same_rows_give_the_same_bytes() {
        let made = || {
            let mut sheet = Sheet::new();
            let rows = vec![vec!["µ ✓ ∑".to_owned(), "\u{2212}1.5".to_owned()]; 60];
            sheet.table(&[("What", 0.5), ("mm", 0.5)], &rows, 8.0);
            assert_eq!(sheet.pages.len(), 2);
            sheet.finish("title").expect("a PDF")
        };
        let pdf = made();
        assert!(pdf.starts_with(b"%PDF-"));
        assert_eq!(pdf, made());
    }
}
