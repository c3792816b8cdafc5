# To be sourced where gpio-sim is: a chip of eight lines. Sets FXDYN_GPIO_CHIP and FXDYN_GPIO_FAR.
sim=/sys/kernel/config/gpio-sim/fxdyn
mkdir -p $sim/bank
echo 8 >$sim/bank/num_lines
echo 1 >$sim/live
FXDYN_GPIO_CHIP=$(cat $sim/bank/chip_name)
FXDYN_GPIO_FAR=/sys/devices/platform/$(cat $sim/dev_name)/$FXDYN_GPIO_CHIP
export FXDYN_GPIO_CHIP FXDYN_GPIO_FAR
