//! A page as a PDF.

use pdf_writer::{Content, Finish as _, Name, Pdf, Rect, Ref, Str, TextStr};

use super::{Shape, Sheet};

/// Points of a PDF in a millimetre.
const POINTS_PER_MM: f64 = 72.0 / 25.4;
/// Handles of a quarter circle drawn as a cubic curve, as a part of the radius: with an error of at most 0.03 % of it.
const HANDLE: f64 = 0.552_284_75;

/// Writes a page. Its coordinates are millimetres from the top left corner, by one transformation at its beginning, so
/// that every number in it can be read with a ruler; all that is black is one filled path.
pub fn pdf(sheet: &Sheet) -> Vec<u8> {
    let ids: [Ref; 6] = std::array::from_fn(|i| Ref::new(i as i32 + 1));
    let [catalog, pages, page, font, content, info] = ids;
    let mut pdf = Pdf::new();
    let mut root = pdf.catalog(catalog);
    root.pages(pages);
    // Asks viewers not to fit the page to the printer.
    root.viewer_preferences().pair(Name(b"PrintScaling"), Name(b"None"));
    root.finish();
    pdf.pages(pages).kids([page]).count(1);
    let [width, height] = sheet.size_mm.map(|mm| (mm * POINTS_PER_MM) as f32);
    let mut leaf = pdf.page(page);
    leaf.media_box(Rect::new(0.0, 0.0, width, height));
    leaf.parent(pages);
    leaf.contents(content);
    leaf.resources().fonts().pair(Name(b"F1"), font);
    leaf.finish();
    pdf.type1_font(font).base_font(Name(b"Helvetica"));
    pdf.stream(content, &drawn(sheet));
    let title = sheet.texts.iter().max_by_key(|t| t.text.len()).map_or("target", |t| t.text.as_str());
    pdf.document_info(info).title(TextStr(title));
    pdf.finish()
}

fn drawn(sheet: &Sheet) -> Vec<u8> {
    let mut content = Content::new();
    let scale = POINTS_PER_MM as f32;
    content.save_state();
    content.transform([scale, 0.0, 0.0, -scale, 0.0, (sheet.size_mm[1] * POINTS_PER_MM) as f32]);
    content.set_fill_gray(0.0);
    for shape in &sheet.drawing.shapes {
        add(&mut content, shape, 1e3, sheet.origin_mm);
    }
    for shape in sheet.ruler_shapes() {
        add(&mut content, &shape, 1.0, [0.0, 0.0]);
    }
    content.fill_nonzero();
    content.restore_state();
    for text in &sheet.texts {
        let [x, y] = [text.at_mm[0], sheet.size_mm[1] - text.at_mm[1]].map(|mm| rounded(mm * POINTS_PER_MM));
        content.begin_text();
        content.set_font(Name(b"F1"), rounded(text.size_mm * POINTS_PER_MM));
        content.next_line(x, y);
        content.show(Str(text.text.as_bytes()));
        content.end_text();
    }
    content.finish().into_vec()
}

/// Adds a shape to the path: its coordinates times `scale`, from `origin`.
fn add(content: &mut Content, shape: &Shape, scale: f64, origin: [f64; 2]) {
    let at = |x: f64, y: f64| (rounded(origin[0] + x * scale), rounded(origin[1] + y * scale));
    match shape {
        Shape::Rectangle { corner, size } => {
            // Both corners are rounded, so that shapes that touch on the target touch on paper.
            let (x, y) = at(corner.x, corner.y);
            let (right, bottom) = at(corner.x + size.x, corner.y + size.y);
            content.rect(x, y, rounded(f64::from(right - x)), rounded(f64::from(bottom - y)));
        }
        Shape::Dot { centre, radius } => {
            let p = |dx: f64, dy: f64| at(centre.x + dx * radius, centre.y + dy * radius);
            let (x, y) = p(1.0, 0.0);
            content.move_to(x, y);
            let quarters = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)];
            for (i, (ax, ay)) in quarters.into_iter().enumerate() {
                let (bx, by) = quarters[(i + 1) % 4];
                let (x1, y1) = p(ax + HANDLE * bx, ay + HANDLE * by);
                let (x2, y2) = p(bx + HANDLE * ax, by + HANDLE * ay);
                let (x3, y3) = p(bx, by);
                content.cubic_to(x1, y1, x2, y2, x3, y3);
            }
            content.close_path();
        }
    }
}

/// To a ten-thousandth: a tenth of a micrometre on paper, and never a number so small that it is written with an
/// exponent, which PDF does not know.
fn rounded(value: f64) -> f32 {
    ((value * 1e4).round() / 1e4) as f32
}
