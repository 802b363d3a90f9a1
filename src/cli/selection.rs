//! Keeps a message of Mesa out of our output.
//!
//! Mesa's Vulkan layer `device_select` asks the Wayland display which device it is on. Without `XDG_RUNTIME_DIR` the
//! Wayland library then prints an error, though nothing is wrong. The program chooses its device itself, so it can do
//! without the layer, which `NODEVICE_SELECT=1` turns off. The layer reads the variable of its own process, and a
//! process cannot safely change its variables; so the program replaces itself by one that has it.

/// Starts the program anew without the layer, where the layer would print its error. Returns where there is no need, or
/// where it cannot be done.
#[cfg(all(feature = "gpu", target_os = "linux"))]
pub(super) fn leave_out() {
    use std::env;
    use std::os::unix::process::CommandExt as _;
    use std::process::Command;

    const OFF: &str = "NODEVICE_SELECT";
    if env::var_os("XDG_RUNTIME_DIR").is_some() || env::var_os(OFF).is_some() {
        return;
    }
    let (Ok(program), mut arguments) = (env::current_exe(), env::args_os()) else { return };
    let mut command = Command::new(program);
    if let Some(name) = arguments.next() {
        command.arg0(name);
    }
    // Returns only if it fails; then the message is printed, and nothing else happens.
    let _ = command.args(arguments).env(OFF, "1").exec();
}

/// No other system has the layer.
#[cfg(not(all(feature = "gpu", target_os = "linux")))]
pub(super) fn leave_out() {}
