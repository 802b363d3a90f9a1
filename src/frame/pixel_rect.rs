//! A rectangle of pixels.

/// The pixels of some columns and rows. Both ends belong to it; it is empty where a last one comes before its first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PixelRect {
    /// First pixel column.
    pub first_column: i32,
    /// Last pixel column.
    pub last_column: i32,
    /// First pixel row.
    pub first_row: i32,
    /// Last pixel row.
    pub last_row: i32,
}

impl PixelRect {
    /// An image of `size` pixels, whole.
    pub(crate) const fn of_image(size: [u32; 2]) -> Self {
        Self { first_column: 0, last_column: size[0] as i32 - 1, first_row: 0, last_row: size[1] as i32 - 1 }
    }

    /// First and last column, then first and last row: the form that programs of the device and splats have.
    #[inline(always)]
    pub(crate) const fn to_array(self) -> [i32; 4] {
        [self.first_column, self.last_column, self.first_row, self.last_row]
    }

    /// First column and first row.
    pub(crate) const fn corner(self) -> [i32; 2] {
        [self.first_column, self.first_row]
    }

    /// Columns and rows.
    pub(crate) const fn size(self) -> [u32; 2] {
        [(self.last_column + 1 - self.first_column) as u32, (self.last_row + 1 - self.first_row) as u32]
    }

    /// Columns and rows of tiles with `edge` pixels an edge that hold the rectangle, from its corner on.
    pub(crate) fn tiles(self, edge: u32) -> [u32; 2] {
        self.size().map(|pixels| pixels.div_ceil(edge))
    }

    /// As a splat's bounds, counted from pixel `corner`.
    #[inline(always)]
    pub(crate) const fn bounds(self, corner: [i32; 2]) -> [u16; 4] {
        let [x, y] = corner;
        [
            (self.first_column - x) as u16,
            (self.last_column - x) as u16,
            (self.first_row - y) as u16,
            (self.last_row - y) as u16,
        ]
    }

    /// The rectangle and `guard` pixels around it. The guard is narrower where a splat's bounds could not number so
    /// many.
    pub(crate) fn guarded(self, guard: u32) -> Self {
        let [width, height] = self.size();
        let room = |pixels: u32| guard.min((u32::from(u16::MAX) + 1).saturating_sub(pixels) / 2);
        let guard = room(width).min(room(height)) as i32;
        Self {
            first_column: self.first_column - guard,
            last_column: self.last_column + guard,
            first_row: self.first_row - guard,
            last_row: self.last_row + guard,
        }
    }

    /// The rectangle and `pixels` more on each side, within an image of `size` pixels.
    pub(crate) fn widened(self, pixels: i32, size: [u32; 2]) -> Self {
        Self {
            first_column: (self.first_column - pixels).max(0),
            last_column: (self.last_column + pixels).min(size[0] as i32 - 1),
            first_row: (self.first_row - pixels).max(0),
            last_row: (self.last_row + pixels).min(size[1] as i32 - 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_guard_goes_all_around() {
        let guarded = PixelRect { first_row: 32, ..PixelRect::of_image([70, 50]) }.guarded(10);
        assert_eq!(guarded.to_array(), [-10, 79, 22, 59]);
        assert_eq!(guarded.tiles(32), [3, 2]);
        assert_eq!(guarded.bounds(guarded.corner()), [0, 89, 0, 37]);
    }

    #[test]
    fn a_guard_leaves_pixels_that_bounds_can_number() {
        assert_eq!(PixelRect::of_image([65_530, 1]).guarded(100).to_array(), [-3, 65_532, -3, 3]);
    }

    #[test]
    fn an_image_without_pixels_has_no_tiles() {
        assert_eq!(PixelRect::of_image([0, 5]).tiles(32), [0, 1]);
    }
}
