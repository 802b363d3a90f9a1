//! The shading equation (thesis 4.1.1).
