//! How the memory that a frame may take is shared out.

use super::bin::Binned;
use super::chunk::CHUNK;
use super::paint::PaintBuffers;
use super::published::Map;
use super::resolve::TileFilm;
use super::shadows::Shadows;
use super::tile_buffers::TileBuffers;
use super::tiles::{Band, TILE};
use super::transparent;

use crate::backend::BackendError;
use crate::film::FilmPlanes;
use crate::frame::{Frame, FrameObject};
use crate::layout::{Channels, EwaSplat, Splat, SweptSplat};

/// How the allowed memory is shared out.
pub(in crate::backend) struct Budget {
    /// Rows of tiles that are rendered together.
    pub band_rows: usize,
    /// Bytes for splats and their lists.
    pub splat_bytes: u64,
    /// Bytes for splats of captures and their lists.
    pub transparent_bytes: u64,
}

impl Budget {
    pub(in crate::backend) fn of(
        frame: &Frame,
        planes: &FilmPlanes,
        channels: &Channels,
    ) -> Result<Self, BackendError> {
        let sizes = || frame.rasters.iter().map(|raster| raster.area.size);
        let raster = sizes().reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])]).unwrap_or(frame.size);
        let samples = frame.samples_of_a_group();
        let tiles = |size: [u32; 2]| size.map(|pixels| u64::from(pixels).div_ceil(TILE as u64));
        let [_, tiles_y] = tiles(raster);
        let all_tiles: u64 = sizes().map(tiles).map(|[x, y]| x * y).sum();
        let pixels = u64::from(frame.size[0]) * u64::from(frame.size[1]);
        // Other pictures, the film, the picture that it becomes, and its copy in the file's form.
        let film =
            frame.picture_bytes + all_tiles * TileFilm::bytes(planes.count) + 2 * pixels * 4 * planes.count as u64;
        let film = film + Shadows::most_bytes(frame);
        // What the tiles of some rows need together, for as many rows as the bands shall have.
        let swept = frame.swept.is_some();
        // Each slice has a threshold, and the depth of the nearest kernel where that is kept.
        let planes_of_slice = 1 + usize::from(frame.keeps_nearest);
        let slices = swept.then(|| planes_of_slice * frame.slices() as usize);
        let guard = frame.guard();
        let see_through = frame.has_see_through();
        // See-through surfels have a channel more, their opacity.
        let most_channels = channels.count + usize::from(see_through);
        let rest_bytes = if frame.shares_rest() { TileFilm::bytes_with_threshold(planes.count) } else { 0 };
        let filtered = frame.has_filtered_kernels() || see_through;
        let buffers = |rows: u64| {
            let band = Band::new(raster, [0, rows as usize]);
            let tiles = band.len() as u64;
            let guarded = guard.map_or(0, |guard| band.guarded(guard).len() as u64);
            // Tiles of the map have fewer buffers, but there are more of them.
            let of_map = guarded * PaintBuffers::bytes(1, false, false);
            let of_tile = TileBuffers::bytes(most_channels, samples, slices);
            let own =
                of_tile + if swept { 0 } else { PaintBuffers::bytes(most_channels, filtered, frame.keeps_nearest) };
            let own = guarded * Map::bytes(1) + of_map.max(tiles * own);
            let own = own + if frame.blending.is_some() { tiles * transparent::bytes_of_tile(planes.count) } else { 0 };
            let own = own + if see_through { tiles * transparent::bytes_of_layers(planes.count) } else { 0 };
            own + tiles * rest_bytes
        };
        let threads = rayon::current_num_threads() as u64;
        let batch = |rows: u64| {
            let band = Band::new(raster, [0, rows as usize]);
            let guarded = guard.map_or(band, |guard| band.guarded(guard));
            let moving = if swept { Binned::<SweptSplat>::most_bytes(CHUNK, channels.count, &band) } else { 0 };
            let ewa = if filtered { Binned::<EwaSplat>::most_bytes(CHUNK, most_channels, &band) } else { 0 };
            let moving = moving + ewa;
            let gaussians = if frame.blending.is_some() { CHUNK as u64 * transparent::BYTES } else { 0 };
            let moving = moving + gaussians;
            (threads + 1) * (Binned::<Splat>::most_bytes(CHUNK, channels.count, &guarded) + moving)
        };
        let gaussians = frame.objects.iter().filter_map(|object| object.shape.gaussians());
        let gaussians: u64 = gaussians.map(|model| model.gaussians().len() as u64).sum();
        let film = film + gaussians * transparent::BYTES_OF_RANK;
        let needed = frame.model_bytes + film + buffers(1) + batch(1);
        BackendError::check_memory(frame, needed)?;
        // Half of what is left for the tiles' buffers at the most; the rest for splats.
        let left = frame.memory - frame.model_bytes - film;
        let rows = (1..=tiles_y).rev().find(|&rows| buffers(rows) <= left / 2).unwrap_or(1);
        let splat_bytes = left.saturating_sub(buffers(rows)).max(batch(rows));
        // Opaque and transparent splats take turns, but their memory stays.
        let opaque = frame.objects.iter().any(FrameObject::has_surfels);
        let (splat_bytes, transparent_bytes) = match (frame.blending.is_some(), opaque) {
            (false, _) => (splat_bytes, 0),
            (true, false) => (0, splat_bytes),
            (true, true) => (splat_bytes / 2, splat_bytes / 2),
        };
        Ok(Self { band_rows: rows as usize, splat_bytes, transparent_bytes })
    }
}
