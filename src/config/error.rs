//! What can be wrong with the options of a job.

/// What is wrong with the options of a job. All of it is an error of use: exit code 2.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The configuration file cannot be read.
    #[error("{path}: cannot read the configuration: {source}")]
    Read {
        /// The file.
        path: String,
        /// The reason that the system gives.
        source: std::io::Error,
    },
    /// The configuration file is no TOML, has an unknown option, or a value of the wrong kind.
    #[error("{path}: {message}")]
    Parse {
        /// The file.
        path: String,
        /// What is wrong, with line and column.
        message: String,
    },
    /// A value is out of its range.
    #[error("{option} {value}: {remedy}")]
    Value {
        /// The option, as written on the command line.
        option: &'static str,
        /// The value, as written.
        value: String,
        /// The range, or another option that helps.
        remedy: &'static str,
    },
    /// The file or the text that an option names cannot be used.
    #[error("{option} {value}: {problem}")]
    Named {
        /// The option, as written on the command line.
        option: &'static str,
        /// The file or the text that it names.
        value: String,
        /// What is wrong with it.
        problem: String,
    },
    /// The words of a command cannot be read; the text says which, and what was expected.
    #[error("{0}")]
    Words(String),
    /// Not exactly one of `--spacing`, `--count` and `--ratio` is given.
    #[error("give one of --spacing, --count and --ratio ({given} given)")]
    Target {
        /// The number of them that are given.
        given: usize,
    },
}
