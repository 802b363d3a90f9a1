//! `splatblur info --adapters`: what `render --backend gpu` could use.

#[cfg(feature = "gpu")]
use super::output::{print, print_json};

#[cfg(feature = "gpu")]
pub(super) fn list(json: bool) -> anyhow::Result<()> {
    use std::fmt::Write as _;

    use serde_json::json;
    use splatblur::renderer::adapters;

    let found = adapters();
    if json {
        let adapters: Vec<_> = found
            .iter()
            .map(|a| {
                json!({
                    "name": a.name, "kind": a.kind, "interface": a.interface, "driver": a.driver,
                    "largest_buffer_bytes": a.buffer_bytes, "largest_binding_bytes": a.binding_bytes,
                    "storage_buffers": a.storage_buffers, "workgroups": a.workgroups, "timestamps": a.timestamps,
                })
            })
            .collect();
        return print_json(&json!({ "adapters": adapters }));
    }
    let mut text = String::new();
    for a in &found {
        let _ = writeln!(
            text,
            "{}\n  {}, {}, driver {}\n  largest buffer {} MiB, of which a program reaches {} MiB; {} storage buffers; \
             {} workgroups; {}",
            a.name,
            a.kind,
            a.interface,
            a.driver,
            a.buffer_bytes >> 20,
            a.binding_bytes >> 20,
            a.storage_buffers,
            a.workgroups,
            if a.timestamps { "measures times" } else { "measures no times" },
        );
    }
    if found.is_empty() {
        text.push_str(
            "No graphics adapters. A GPU needs its Vulkan driver and the Vulkan loader (Debian: libvulkan1); \
             mesa-vulkan-drivers brings a software device.\n",
        );
    }
    print(&text)
}

#[cfg(not(feature = "gpu"))]
pub(super) fn list(_json: bool) -> anyhow::Result<()> {
    anyhow::bail!("built without the GPU backend (cargo feature `gpu`)")
}
