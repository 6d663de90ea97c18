"""Whether a job that was killed had delivered its output already."""


def was_delivered(output, reference, said):
    """Whether a run, which said this on standard error, was refused because an earlier run had delivered the whole output, with
    the bytes of the reference. The earlier run was stopped in the milliseconds between that and its exit."""
    return "exists already" in said and output.read_bytes() == reference
