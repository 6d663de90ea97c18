//! What stands where in the bytes of files and of records: every byte offset is here.

pub(crate) mod record;
