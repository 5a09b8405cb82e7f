import { defineConfig } from "vite";

// Names without hashes, and nothing of this machine in the files: the same source gives the same bytes.
export default defineConfig({
  base: "./",
  build: {
    outDir: "../src/scan2nurbs/studio/static",
    emptyOutDir: true,
    target: "es2022",
    modulePreload: false,
    chunkSizeWarningLimit: 2000,
    rollupOptions: {
      output: {
        entryFileNames: "assets/studio.js",
        chunkFileNames: "assets/[name].js",
        assetFileNames: "assets/[name][extname]",
      },
    },
  },
});
