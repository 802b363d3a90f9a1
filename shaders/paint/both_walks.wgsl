// The walk over the splats of a tile of the view: those at rest, then its own.

fn walk_at(tile: vec2<u32>) -> Walk {
    var walk = walk_of(tile_of(tile));
    if view.rest == view.number { return walk; }
    let index = rest_tile_of(tile);
    let wide_at = view.round_tiles + 1u + view.rest;
    let rest = Walk(starts[index], starts[index + 1u], starts[wide_at], starts[wide_at + 1u], 0u, 0u, 0u, 0u);
    walk.later = walk.next;
    walk.later_end = walk.end;
    walk.later_wide = walk.next_wide;
    walk.later_end_wide = walk.end_wide;
    walk.next = rest.next;
    walk.end = rest.end;
    walk.next_wide = rest.next_wide;
    walk.end_wide = rest.end_wide;
    return walk;
}
