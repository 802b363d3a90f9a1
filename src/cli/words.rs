//! Options of the library in the words of the command line.

/// Names of options in messages of the library, and the flags that set them.
const FLAGS: [(&str, &str); 4] = [
    ("RenderOptions::memory", "--memory"),
    ("ErrorTarget::samples_max", "--samples-max"),
    ("Device::Cpu", "--backend cpu"),
    ("Recipe::flow = false", "--no-flow"),
];

/// A message of the library, with flags in place of its options.
pub(crate) fn with_flags(message: &str) -> String {
    FLAGS.iter().fold(message.to_owned(), |text, (option, flag)| text.replace(option, flag))
}

#[cfg(test)]
mod tests {
    use splatblur::backend::BackendError;

    use super::*;

    #[test]
    fn messages_name_flags() {
        let error = BackendError::Memory { width: 8, height: 6, models: 1, needed: 3, allowed: 2 };
        assert!(error.to_string().ends_with("it takes RenderOptions::memory 1M"), "{error}");
        assert!(with_flags(&error.to_string()).ends_with("it takes --memory 1M"));
        assert!(with_flags(&BackendError::NotBuilt.to_string()).ends_with("; use --backend cpu"));
    }
}
