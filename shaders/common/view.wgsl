// The view of programs that work on one group at a time. Its other form: common/views.wgsl.

@group(0) @binding(0) var<uniform> view: View;
