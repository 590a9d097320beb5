/**
 * A printer as many have it; the lists end with the extruder.
 */
#define CONFIGURATION_H_VERSION 02010300
#define MOTHERBOARD BOARD_RAMPS_14_EFB
//#define COREXY
//#define DELTA
#define X_DRIVER_TYPE  DRV8825
#define Y_DRIVER_TYPE  DRV8825
#define Z_DRIVER_TYPE  DRV8825
#define DEFAULT_AXIS_STEPS_PER_UNIT   { 160, 160, 800, 93 }
#define DEFAULT_MAX_FEEDRATE          { 200, 200, 6, 50 }
#define DEFAULT_MAX_ACCELERATION      { 2000, 2000, 90, 10000 }
#define DEFAULT_ACCELERATION          1200    // for printing moves
#define CLASSIC_JERK
#if DISABLED(CLASSIC_JERK)
  #define JUNCTION_DEVIATION_MM 0.013
#endif
#define S_CURVE_ACCELERATION
#define X_HOME_DIR -1
#define Y_HOME_DIR 1
#define Z_HOME_DIR -1
#define X_BED_SIZE 210
#define Y_BED_SIZE 200
#define X_MIN_POS 0
#define Y_MIN_POS -2
#define Z_MIN_POS 0
#define X_MAX_POS X_BED_SIZE
#define Y_MAX_POS (Y_BED_SIZE + 4)
#define Z_MAX_POS 180
#define HOMING_FEEDRATE_MM_M { (50*60), (50*60), (4*60) }
