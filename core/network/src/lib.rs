//! Runs a texture network from an ONNX file.
