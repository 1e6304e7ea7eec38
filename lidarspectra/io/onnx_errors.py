"""What onnxruntime raises."""


def onnx_errors() -> tuple[type[Exception], ...]:
    """Whatever onnxruntime raises; its exceptions have no base of their own."""
    from onnxruntime.capi import onnxruntime_pybind11_state as state

    named = [value for value in vars(state).values() if isinstance(value, type) and issubclass(value, Exception)]
    return (*named, ValueError, RuntimeError)
