//! Several frames on one sheet, in rows.

use std::io::Write;

use super::canvas::{Canvas, PAPER_COLOR, write_rgb};

/// The width of the gaps between frames, in pixels.
const GAP: usize = 4;

/// Writes `frames` as one PNG: as rows of frames of one size, with gaps between them. Each is shaded on its own.
///
/// # Errors
///
/// If `out` takes no more.
pub(crate) fn write_sheet<const COLUMNS: usize>(
    frames: &[[Canvas; COLUMNS]],
    out: impl Write,
) -> std::io::Result<()> {
    let gap_color = PAPER_COLOR.map(|c| c / 2);
    let mut sheet: Vec<u8> = Vec::new();
    let (mut width, mut height) = (0, 0);
    for (index, row) in frames.iter().enumerate() {
        let [frame_width, frame_height] = row.first().map_or([0; 2], Canvas::size);
        let [frame_width, frame_height] = [frame_width as usize, frame_height as usize];
        width = (COLUMNS * (frame_width + GAP)).saturating_sub(GAP);
        if index > 0 {
            sheet.extend(gap_color.repeat(width * GAP));
            height += GAP;
        }
        let shaded: Vec<Vec<u8>> = row.iter().map(Canvas::shaded).collect();
        for y in 0..frame_height {
            for (column, frame) in shaded.iter().enumerate() {
                if column > 0 {
                    sheet.extend(gap_color.repeat(GAP));
                }
                sheet.extend(&frame[3 * y * frame_width..][..3 * frame_width]);
            }
        }
        height += frame_height;
    }
    write_rgb(&sheet, [width as u32, height as u32], out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_stand_side_by_side_with_gaps() {
        let mut right = Canvas::new([10, 8]);
        right.disc([5.0, 4.0], 1.0, 30.0, [200, 0, 0]);
        let row = [Canvas::new([10, 8]), right];
        let mut file = Vec::new();
        write_sheet(&[row.clone(), row], &mut file).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(file))
            .read_info()
            .unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height), (24, 20));
        let pixel = |x: usize, y: usize| &pixels[3 * (24 * y + x)..][..3];
        assert_eq!(pixel(5, 4), PAPER_COLOR);
        assert_eq!(pixel(19, 4), [200, 0, 0]);
        assert_eq!(pixel(19, 16), [200, 0, 0]);
        assert_eq!(pixel(11, 4), pixel(3, 9));
    }
}
