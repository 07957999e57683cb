#!/usr/bin/env bash
# Makes the libraries that the report page embeds (crates/tessuto/assets/vendor/) from their npm packages anew. The
# files are committed; building tessuto needs neither npm nor this script. Needs node and npm.
set -euo pipefail
THREE=0.187.0
UPLOT=1.6.32
ESBUILD=0.28.2
vendor="$(cd "$(dirname "$0")/.." && pwd)/crates/tessuto/assets/vendor"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
npm init --yes > /dev/null
npm install --no-audit --no-fund --ignore-scripts "three@$THREE" "uplot@$UPLOT" "esbuild@$ESBUILD"

# Only what the page uses, so that the rest falls away.
cat > three.js << 'END'
export {
  AmbientLight, BufferAttribute, BufferGeometry, Color, DataTexture, DirectionalLight, DoubleSide,
  EquirectangularReflectionMapping, FloatType, LinearFilter, LineBasicMaterial, LineSegments, Mesh,
  MeshBasicMaterial, MeshLambertMaterial, MeshStandardMaterial, NoColorSpace, NoToneMapping, PerspectiveCamera,
  PMREMGenerator, Raycaster, RepeatWrapping, RGBAFormat, Scene, SRGBColorSpace, Texture, Vector2, Vector3,
  WebGLRenderer,
} from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
END
npx esbuild three.js --bundle --minify --format=iife --global-name=THREE --legal-comments=inline \
  --outfile="$vendor/three.min.js"
cp node_modules/uplot/dist/uPlot.iife.min.js "$vendor/uPlot.min.js"
cp node_modules/uplot/dist/uPlot.min.css "$vendor/uPlot.min.css"
cp node_modules/three/LICENSE "$vendor/three.LICENSE"
cp node_modules/uplot/LICENSE "$vendor/uPlot.LICENSE"
if grep -l '</script' "$vendor"/*.js; then
    echo "a library would end the page's script element" >&2
    exit 1
fi
