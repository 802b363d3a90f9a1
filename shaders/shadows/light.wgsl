// What of shadows needs no map.

// Lights of a mask: a float counts as many exactly. Three masks are in the place of a colour.
const LIGHTS_OF_MASK: u32 = 24u;

// Does the side of a surface with this normal face a light? Else it is dark.
fn faces_light(light: Light, normal: vec3<f32>, place: vec3<f32>) -> bool {
    var towards = light.vector.xyz;
    if light.vector.w != DIRECTIONAL { towards = towards - place; }
    return normal.x * towards.x + normal.y * towards.y + normal.z * towards.z > 0.0;
}
