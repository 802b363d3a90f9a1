//! How a frame is cut up: rasters into bands of tile rows, so that every buffer fits, and surfels into batches.

use super::layout::{DIGIT_BITS, DeviceGaussian, TILE, VIEWS, WIDEST, WORKGROUP_ITEMS, stepped};
use super::shadow_sizes::ShadowSizes;
use super::slots::Slot;
use crate::backend::BackendError;
use crate::film::{Aov, FilmPlanes};
use crate::frame::{Frame, PixelRect, Position, RasterArea};
use crate::layout::{Channels, EwaSplat, FilteredSplat, Splat, SweptSplat};
use crate::options::SweptKernel;
use crate::plan::LAYERS;

/// Pixels of a tile.
const TILE_PIXELS: u64 = (TILE * TILE) as u64;
/// Fewest slots of a batch that are worth a dispatch. Their lists always fit.
pub(in crate::backend) const LEAST_SLOTS: u64 = 1 << 16;
/// Entries of lists for each slot, to begin with.
pub(in crate::backend) const ENTRIES_PER_SLOT: u64 = 3;
/// Bytes of an entry: tile and slot, twice, and its share of the histogram.
const ENTRY_BYTES: u64 = 17;
/// Tiles of a round, beside those of one group, that keep a device busy.
const MOST_ROUND_TILES: u64 = 1 << 14;
/// Slots after which a frame is submitted in parts. Systems take a device for hung that does not answer for some
/// seconds.
pub(in crate::backend) const LONG: u64 = 1 << 24;
/// Groups of a round, what is at rest among them, where groups share that: it is painted once a round.
const SHARING_GROUPS: u64 = 9;
/// Bytes of a tile of the map beside its start: the map and thresholds.
const MAP_TILE_BYTES: u64 = 2 * 4 * TILE_PIXELS + 4;
/// Planes of the coverage mask of kernels in motion that are not published.
pub(in crate::backend) const MASKS: u64 = 5;
/// Bytes of a plane of a tile's coverage mask.
const MASK_BYTES: u64 = 4 * TILE_PIXELS;
/// Bytes of a tile's thresholds.
pub(in crate::backend) const THRESHOLD_BYTES: u64 = 4 * TILE_PIXELS;
/// Bytes of the map of one tile.
pub(in crate::backend) const MAP_BYTES: u64 = 4 * TILE_PIXELS;

/// Bytes of a projected Gaussian and of its place in the order.
const GAUSSIAN_BYTES: u64 = size_of::<DeviceGaussian>() as u64 + 4;

/// Layers of full EWA: before the nearest disc of a pixel, at it, at the next one, and behind that.
const EWA_LAYERS: usize = 4;

/// Bytes of the depths of a tile under full EWA, as `shaders/common/depths.wgsl` has them: of the tile and its apron,
/// in quads, then two more planes of the tile.
pub(in crate::backend) fn ewa_depth_bytes(apron: usize) -> u64 {
    let row = 4 + 2 * (apron as u64).div_ceil(4);
    16 * (row * (u64::from(TILE) + 2 * apron as u64)) + 2 * THRESHOLD_BYTES
}

/// Bytes of the depths and covers of a tile while layers are peeled off, as the same file has them.
pub(in crate::backend) fn peeled_bytes(apron: usize) -> u64 {
    let row = 4 + 2 * (apron as u64).div_ceil(4);
    ewa_depth_bytes(apron) + 16 * (row * (u64::from(TILE) + 2 * apron as u64)) + 4 * THRESHOLD_BYTES + 16
}

/// Layers of sums of see-through surfels of a pixel: before the nearest disc, and at it.
const PEEL_LAYERS: usize = 2;

/// Channels of sums on the device: those of the twin, then three for groups of several samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::backend) struct DeviceChannels {
    pub shared: Channels,
    /// Floats of a splat in `values`.
    pub values: u32,
    /// First of three channels: the sample coverage of the current sample, the coverage by the samples before it, and
    /// the sample coverage of static objects.
    pub sample_coverage: Option<usize>,
    /// Channel of opacities, of see-through surfels alone.
    pub opacity: Option<usize>,
    /// Place of the tolerance among the values of a splat, where kernels in motion have several: `attribute` has no
    /// room for the segments.
    pub tolerance: Option<usize>,
    /// First of three channels of full EWA: weight times peak, weights that are negative for backs, and discs.
    pub peak: Option<usize>,
    pub count: usize,
    /// Sums of each pixel: those of the layers of full EWA, else one.
    pub layers: usize,
    pub composite: CompositeChannels,
}

/// Channels of the composite of captures, volumes and layers. All are 0 in a frame without them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::backend) struct CompositeChannels {
    /// Those that splats have: transmittance, colour, then depth, then velocity.
    pub own: usize,
    /// First of three: normal, where see-through surfels have it.
    pub normal: Option<usize>,
    /// The first one of the open layer of volumes: as many again, optical depth in place of the transmittance; then its
    /// number.
    pub open: Option<usize>,
    /// Number of the next layer of see-through surfels.
    pub next: Option<usize>,
    pub count: usize,
}

impl CompositeChannels {
    fn of(frame: &Frame) -> Self {
        if frame.blending.is_none() {
            return Self::default();
        }
        let own = match [Aov::Depth, Aov::Velocity].map(|aov| frame.aovs.contains(&aov)) {
            [_, true] => 7,
            [true, false] => 5,
            [false, false] => 4,
        };
        let mut count = own;
        let mut take = |wanted: bool, n: usize| {
            wanted.then(|| {
                count += n;
                count - n
            })
        };
        let see_through = frame.has_see_through();
        let normal = take(see_through && frame.aovs.contains(&Aov::Normal), 3);
        let open = take(frame.has_volumes(), own + 1);
        let next = take(see_through, 1);
        Self { own, normal, open, next, count }
    }
}

impl DeviceChannels {
    /// Has a pixel several layers?
    pub(in crate::backend) fn is_layered(&self) -> bool {
        self.layers > 1
    }

    pub(in crate::backend) fn of(frame: &Frame) -> Self {
        Self::with(frame, Channels::of(frame), if frame.has_filtered_kernels() { EWA_LAYERS } else { 1 })
    }

    /// The channels of see-through surfels; `None` where there are none.
    pub(in crate::backend) fn see_through(frame: &Frame) -> Option<Self> {
        frame.has_see_through().then(|| Self::with(frame, Channels::of(frame).with_opacity(), PEEL_LAYERS))
    }

    /// `layers`: those of groups of one sample.
    fn with(frame: &Frame, shared: Channels, layers: usize) -> Self {
        let several = frame.samples_of_a_group() > 1;
        let layered = frame.has_layers(layers > 1);
        // The weight and depth are no values of a splat.
        let values = shared.count - 1 - usize::from(shared.depth.is_some());
        let tolerance = (frame.keeps_nearest && frame.swept.is_some()).then_some(values);
        Self {
            shared,
            values: (values + usize::from(tolerance.is_some())) as u32,
            opacity: shared.opacity,
            tolerance,
            sample_coverage: several.then_some(shared.count),
            peak: layered.then_some(shared.count),
            count: shared.count + if several || layered { 3 } else { 0 },
            layers: if layered { layers } else { 1 },
            composite: CompositeChannels::of(frame),
        }
    }

    /// Floats of a pixel's sums, or of its composite, which takes their place.
    pub(in crate::backend) fn sums(&self) -> usize {
        (self.layers * self.count).max(self.composite.count)
    }
}

/// One raster of the frame and its place in the film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::backend) struct RasterFilm {
    pub place: RasterArea,
    pub tiles: [u32; 2],
    /// First float in the film.
    pub start: u64,
}

/// Tile rows that are rendered together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::backend) struct Band {
    pub first_row: u32,
    pub rows: u32,
}

/// The pixels that passes work on: those of a band, or of the map around it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::backend) struct Area {
    pub pixels: PixelRect,
    /// Pixel from which tiles and their pixels are counted.
    pub corner: [i32; 2],
    /// Tiles in a row and rows of tiles.
    pub tiles: [u32; 2],
    /// Row of tiles, from the corner, of the first one.
    pub first_tile_row: u32,
}

impl RasterFilm {
    /// The pixels of a band.
    pub(in crate::backend) fn area(&self, band: Band) -> Area {
        let first_row = (band.first_row * TILE) as i32;
        let last_row = ((band.first_row + band.rows) * TILE).min(self.place.size[1]) as i32 - 1;
        Area {
            pixels: PixelRect { first_row, last_row, ..PixelRect::of_image(self.place.size) },
            corner: [0; 2],
            tiles: [self.tiles[0], band.rows],
            first_tile_row: band.first_row,
        }
    }
}

impl Area {
    /// The area and `guard` pixels around it, in tiles of its own; as much of them as pixels can be numbered.
    pub(in crate::backend) fn guarded(&self, guard: u32) -> Self {
        let pixels = self.pixels.guarded(guard);
        Self { pixels, corner: pixels.corner(), tiles: pixels.tiles(TILE), first_tile_row: 0 }
    }

    /// Tiles.
    pub(in crate::backend) fn len(&self) -> u64 {
        u64::from(self.tiles[0]) * u64::from(self.tiles[1])
    }
}

/// How a frame is cut up.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::backend) struct Schedule {
    /// In the order of the frame's groups.
    pub rasters: Vec<RasterFilm>,
    /// Bytes of the film.
    pub film_bytes: u64,
    /// Most tiles of a band.
    pub band_tiles: u64,
    /// Most tiles of a map; 0 where there is none.
    pub map_tiles: u64,
    /// Floats of a pixel's sums, of any step.
    pub sums: u64,
    /// Floats of a slot's attributes, of any step.
    pub values: u64,
    /// Bytes of a slot's splat, of any step.
    pub splat_bytes: u64,
    /// Bytes of a tile's thresholds, and of what else is known of its depths.
    pub depth_bytes: u64,
    /// Tile rows of a band, for each raster.
    pub band_rows: Vec<u32>,
    /// Most slots of a batch or slab, and of a batch of surfels, whose lists must not be too long.
    pub slots: u64,
    pub surfel_slots: u64,
    /// Most groups, slots and tiles of a round: of groups that go through the passes together.
    pub round_groups: u64,
    pub round_slots: u64,
    pub round_tiles: u64,
    /// Most entries of a round's lists that may be made room for.
    pub most_entries: u64,
    /// Bytes of a tile's coverage mask; 0 without kernels in motion.
    pub mask_bytes: u64,
    /// Bytes of a tile's thresholds of slices, and of their nearest depths; 0 where there are none.
    pub slice_bytes: u64,
    /// Gaussians of all captures and volumes, of a group and of a round.
    pub gaussians: u64,
    pub round_gaussians: u64,
    /// Bytes of a tile of the opaque picture that what is transparent is laid over; 0 without.
    pub opaque_bytes: u64,
    /// Bytes of a tile of what is peeled off see-through surfels, and of the films of all layers; 0 without them.
    pub peeled_bytes: u64,
    pub layer_bytes: u64,
    /// What the shadows of a group take.
    pub shadows: ShadowSizes,
}

/// The limits of a device.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Limits {
    /// Bytes of a buffer that a program can bind.
    pub bytes: u64,
    /// Slots of a batch or slab, and of a batch of surfels.
    pub slots: u64,
    pub surfel_slots: u64,
    /// Groups of a round.
    pub groups: u64,
    /// Texels of the shadow maps of a light.
    pub shadow_texels: u64,
}

impl Schedule {
    /// Cuts the frame up.
    #[allow(clippy::too_many_lines, reason = "one sum over all buffers")]
    pub(in crate::backend) fn new(
        frame: &Frame,
        channels: &DeviceChannels,
        planes: &FilmPlanes,
        limits: Limits,
    ) -> Result<Self, BackendError> {
        let most_bytes = limits.bytes;
        let (rasters, film_bytes) = films(frame, planes);
        let pixels = u64::from(frame.size[0]) * u64::from(frame.size[1]);
        // Other pictures, the film, its copy for the host, and the picture.
        let film = frame.picture_bytes + 2 * film_bytes + 4 * pixels * planes.count as u64;
        let swept = frame.swept.is_some();
        let mask_bytes = MASK_BYTES
            * match frame.swept {
                Some(kernel) if kernel.is_published() => 3,
                Some(_) => MASKS,
                None => 0,
            };
        let opaque_bytes = if frame.blending.is_some() { 4 * TILE_PIXELS * planes.count as u64 } else { 0 };
        let see_through = DeviceChannels::see_through(frame);
        let sums = see_through.map_or(0, |own| own.sums()).max(channels.sums());
        let values = u64::from(see_through.map_or(0, |own| own.values).max(channels.values));
        let (peeled_bytes, layer_bytes) = match see_through {
            Some(_) => (peeled_bytes(most_apron_of_layers(frame)), 4 * TILE_PIXELS * planes_of_layers(planes)),
            None => (0, 0),
        };
        let (gaussians, gaussian_bytes) = gaussians(frame);
        // Where it is kept, the depth of the nearest disc is a plane like that of the thresholds.
        let (nearest_bytes, planes_of_slice) = if frame.keeps_nearest { (THRESHOLD_BYTES, 2) } else { (0, 1) };
        let slice_bytes = planes_of_slice * THRESHOLD_BYTES * u64::from(frame.slices());
        let apron = frame.positions().map(|position| position.raster.apron()).max().unwrap_or(0);
        let filtered = frame.has_filtered_kernels();
        let depth_bytes = nearest_bytes + if filtered { ewa_depth_bytes(apron) } else { THRESHOLD_BYTES };
        let tile_bytes = {
            let own = depth_bytes + 4 * TILE_PIXELS * sums as u64 + 4 + mask_bytes + peeled_bytes + layer_bytes;
            own + opaque_bytes + slice_bytes
        };
        let widest = rasters.iter().map(|raster| u64::from(raster.tiles[0])).max().unwrap_or(0);
        let tallest = rasters.iter().map(|raster| u64::from(raster.tiles[1])).max().unwrap_or(0);
        let splat_bytes = match frame.swept {
            Some(kernel) if kernel.is_published() => size_of::<SweptSplat>(),
            Some(_) => size_of::<FilteredSplat>(),
            None if filtered || see_through.is_some() => size_of::<EwaSplat>(),
            None => size_of::<Splat>(),
        } as u64;
        let slot_bytes = splat_bytes + 8 + 4 * values + 8 / u64::from(WORKGROUP_ITEMS);
        let least_batch = LEAST_SLOTS * (slot_bytes + u64::from(WIDEST) * ENTRY_BYTES);

        // Tiles of the largest map around a band of so many rows of tiles.
        let guard = frame.guard();
        let map_of = |rows: u32| {
            let around = |raster: &RasterFilm| {
                let rows = rows.min(raster.tiles[1]);
                let middle = Band { first_row: 0, rows };
                guard.map_or(0, |guard| raster.area(middle).guarded(guard).len())
            };
            rasters.iter().map(around).max().unwrap_or(0)
        };
        let least_map = map_of(1) * MAP_TILE_BYTES;

        let shadows = ShadowSizes::of(frame, limits.bytes, limits.shadow_texels)?;
        let shadow_bytes = shadows.map_bytes() + shadows.caster_bytes();

        let needed = {
            let models = frame.model_bytes + film + gaussian_bytes + shadow_bytes;
            models + widest * tile_bytes + least_map + least_batch
        };
        BackendError::check_memory(frame, needed)?;
        let left = frame.memory - frame.model_bytes - film - gaussian_bytes - shadow_bytes;
        let most_planes = sums.max(planes.count) as u64;
        let bound_of_tiles = most_bytes
            / (4 * TILE_PIXELS * most_planes).max(layer_bytes).max(peeled_bytes).max(depth_bytes).max(mask_bytes);
        let band_tiles = bound_of_tiles.min((left - least_batch) / 2 / tile_bytes).max(widest).min(widest * tallest);
        let band_rows: Vec<u32> = rasters
            .iter()
            .map(|raster| {
                (band_tiles / u64::from(raster.tiles[0].max(1))).clamp(1, u64::from(raster.tiles[1].max(1))) as u32
            })
            .collect();
        let (band_tiles, band_rows) = if swept {
            // The map takes its share: fewer rows, until both fit.
            let fits = |rows: u32| {
                u64::from(rows) * widest * tile_bytes + map_of(rows) * MAP_TILE_BYTES <= (left - least_batch) / 2
                    && map_of(rows) * MAP_BYTES + u64::from(rows) * widest * slice_bytes <= most_bytes
            };
            let most: u32 = band_rows.iter().copied().max().unwrap_or(1);
            let rows = (1..=most).rev().find(|&rows| fits(rows)).unwrap_or(1);
            (widest * u64::from(rows), band_rows.iter().map(|&of: &u32| of.min(rows)).collect())
        } else {
            (band_tiles, band_rows)
        };
        let map_tiles = map_of(band_rows.iter().copied().max().unwrap_or(0));
        let left = left - band_tiles * tile_bytes - map_tiles * MAP_TILE_BYTES;
        let samples = frame.samples_of_a_group() as u64;
        let models = frame.objects.iter().filter_map(|object| object.shape.surfels());
        let surfels: u64 = models.map(|model| model.surfels().len() as u64).sum();
        let of_group = if surfels > 0 { stepped(samples * surfels) } else { 0 };
        let bound = most_bytes / splat_bytes.max(4 * values);
        // Slots leave room for the entries of the least batch, which those of Gaussians count on.
        let fit = (left / (slot_bytes + ENTRIES_PER_SLOT * ENTRY_BYTES))
            .min(left.saturating_sub(LEAST_SLOTS * u64::from(WIDEST) * ENTRY_BYTES) / slot_bytes);
        let slots = of_group.max(gaussians).min(fit).max(LEAST_SLOTS).min(bound).min(limits.slots);
        let surfel_slots = slots.min(limits.surfel_slots);
        // What is left beside the lists of a batch makes room for rounds, and for longer lists.
        let each_slot = slot_bytes + ENTRIES_PER_SLOT * ENTRY_BYTES;
        let each_group = of_group.max(gaussians).clamp(1, slots);
        // A group of a round has its own Gaussians, sorted by depth and then by group.
        let gaussian_bytes = gaussians * (GAUSSIAN_BYTES + ENTRY_BYTES);
        let most_sorted = 65_535 * u64::from(WORKGROUP_ITEMS);
        let spare = left.saturating_sub(slots * each_slot + LEAST_SLOTS * u64::from(WIDEST) * ENTRY_BYTES) / 2;
        let round_groups = if makes_rounds(frame) && band_tiles == widest * tallest && gaussians <= slots {
            let tile_bound = bound_of_tiles.min(most_bytes / slice_bytes.max(1)) / band_tiles.max(1);
            let slot_bound = 1 + bound.saturating_sub(slots) / each_group;
            let gaussian_bound = match gaussians {
                0 => u64::MAX,
                _ => (most_bytes / GAUSSIAN_BYTES).min(most_sorted) / gaussians,
            };
            let sorted_groups = if gaussians > 0 { 1 << DIGIT_BITS } else { u64::MAX };
            let enough = 1 + MOST_ROUND_TILES / band_tiles.max(1);
            let shares_rest = frame.shares_rest() && frame.blending.is_none();
            let shares = if shares_rest { SHARING_GROUPS } else { 1 };
            (1 + spare / (band_tiles * tile_bytes + each_group * each_slot + gaussian_bytes + shadow_bytes).max(1))
                .min(most_bytes / shadows.map_bytes().max(shadows.caster_bytes()).max(1))
                .min(enough.max(shares))
                .min(limits.groups)
                .min(tile_bound)
                .min(slot_bound)
                .min(1 + LONG / each_group)
                .min(gaussian_bound)
                .min(sorted_groups)
                // What is at rest takes a place of its own.
                .min(frame.positions().map(|position| position.groups.len() as u64 + u64::from(shares_rest)).sum())
                .max(1)
        } else {
            1
        };
        let left = left - (round_groups - 1) * (band_tiles * tile_bytes + gaussian_bytes + shadow_bytes);
        let round_gaussians = round_groups * gaussians;
        let (round_slots, round_tiles) = (slots + (round_groups - 1) * each_group, round_groups * band_tiles);
        let most_entries = ((left.saturating_sub(round_slots * slot_bytes)) / ENTRY_BYTES)
            .max(LEAST_SLOTS * u64::from(WIDEST))
            .max(round_gaussians)
            .min(most_bytes / 4)
            .min(most_sorted);
        Ok(Self {
            rasters,
            film_bytes,
            band_tiles,
            map_tiles,
            sums: sums as u64,
            values,
            splat_bytes,
            depth_bytes,
            band_rows,
            slots,
            surfel_slots,
            round_groups,
            round_slots,
            round_tiles,
            most_entries,
            mask_bytes,
            slice_bytes,
            gaussians,
            round_gaussians,
            opaque_bytes,
            peeled_bytes,
            layer_bytes,
            shadows,
        })
    }

    /// Bytes that a frame takes in the buffer of a slot, without the entries of lists.
    pub(in crate::backend) fn bytes(&self, slot: Slot) -> u64 {
        let (slots, band, map) = (self.round_slots, self.round_tiles, self.map_tiles);
        match slot {
            Slot::Splats => slots * self.splat_bytes,
            Slot::Touched | Slot::Wide => 4 * slots,
            Slot::Partials => 8 * slots.div_ceil(u64::from(WORKGROUP_ITEMS)),
            Slot::Values => 4 * self.values * slots,
            Slot::Starts => 4 * (band.max(map) + 2 + u64::from(VIEWS)),
            Slot::Thresholds => (self.depth_bytes * band).max(THRESHOLD_BYTES * map),
            Slot::Sums => 4 * TILE_PIXELS * self.sums * band,
            Slot::Map => MAP_BYTES * map + self.slice_bytes * band,
            Slot::CoverageMask => self.mask_bytes * band,
            Slot::Gaussians => self.round_gaussians * size_of::<DeviceGaussian>() as u64,
            Slot::Order => 4 * self.round_gaussians,
            Slot::Opaque => self.opaque_bytes * band,
            Slot::Peeled => self.peeled_bytes * band,
            Slot::Layers => self.layer_bytes * band,
            Slot::ShadowMaps => self.round_groups * self.shadows.map_bytes(),
            Slot::Casters => self.round_groups * self.shadows.caster_bytes(),
            Slot::Film => self.film_bytes,
            _ => 0,
        }
    }

    /// The bands of raster `index`.
    pub(in crate::backend) fn bands(&self, index: usize) -> impl Iterator<Item = Band> + use<> {
        let (all, step) = (self.rasters[index].tiles[1], self.band_rows[index]);
        let some = if self.rasters[index].tiles[0] == 0 { 0 } else { all };
        (0..some).step_by(step as usize).map(move |first_row| Band { first_row, rows: step.min(all - first_row) })
    }
}

/// Do groups of a frame go through the passes together? Those of several samples that something transparent is laid
/// over come one by one, for each of them has several pictures; and so do published kernels in motion, which share a
/// map.
pub(in crate::backend) fn makes_rounds(frame: &Frame) -> bool {
    let is_published = frame.swept.is_some_and(SweptKernel::is_published);
    !is_published && (frame.blending.is_none() || frame.samples_of_a_group() == 1)
}

/// Widest apron of see-through surfels.
fn most_apron_of_layers(frame: &Frame) -> usize {
    let apron = |position: &Position| position.raster.for_see_through(frame.prefilter).apron();
    frame.positions().map(apron).max().unwrap_or(0)
}

/// Planes of the films of all layers of a pixel: each has those of the film, and its depth.
pub(in crate::backend) fn planes_of_layers(planes: &FilmPlanes) -> u64 {
    u64::from(LAYERS) * (planes.count as u64 + 1)
}

/// The films of a frame's rasters, and the bytes of all.
fn films(frame: &Frame, planes: &FilmPlanes) -> (Vec<RasterFilm>, u64) {
    let (mut rasters, mut film_floats) = (Vec::new(), 0);
    for raster in &frame.rasters {
        let tiles = raster.area.size.map(|pixels| pixels.div_ceil(TILE));
        rasters.push(RasterFilm { place: raster.area, tiles, start: film_floats });
        film_floats += u64::from(tiles[0]) * u64::from(tiles[1]) * TILE_PIXELS * planes.count as u64;
    }
    (rasters, 4 * film_floats)
}

/// Gaussians of all captures and volumes, and the bytes that they take beside those of a batch. All of a sample are on
/// the device, and are sorted together.
fn gaussians(frame: &Frame) -> (u64, u64) {
    let captures = frame.objects.iter().filter_map(|object| object.shape.gaussians());
    let count = captures.map(|model| model.gaussians().len() as u64).sum::<u64>();
    let more_entries = count.saturating_sub(LEAST_SLOTS * u64::from(WIDEST));
    (count, count * GAUSSIAN_BYTES + more_entries * ENTRY_BYTES)
}
